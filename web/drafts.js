// Which versions are drafts that nobody needs any more. Pure.

/** Numbers of the drafts that a new result has replaced: made of the same version, and by nobody kept, named, gone on from
 *  or looked at.
 *    drafts  [{version, base}] that this page has asked for
 *    made    {version, base} of what is there now */
export function superseded(drafts, made, versions, shown) {
  return drafts
    .filter(({ version, base }) => base === made.base && version !== made.version && version !== shown)
    .map(({ version }) => versions.find((v) => v.version === version))
    .filter((version) => version && !version.name && !versions.some(({ parent }) => parent === version.version))
    .map(({ version }) => version);
}

/** Versions as a tree, each after the one it was made from: [{version, depth}]; of one parent the youngest first. */
export function treeOf(versions) {
  const below = (parent, depth) =>
    versions
      .filter((v) => v.parent === parent)
      .reverse()
      .flatMap((version) => [{ version, depth }, ...below(version.version, depth + 1)]);
  return below(null, 0);
}
