// Scenes to test with: a demo scene made by the program, and the real capture of a fox where it is at hand.
import { existsSync, readFileSync } from 'node:fs';
import { readdir, readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { root, run, temporaryFolder } from './program.mjs';
import { zip } from './zip.mjs';

/// A demo scene: {folder, ply, ball, leaf}; `ball` and `leaf` are requests without a scene that deform only, which is quick.
///   photos  whether its views are rendered as photos of the dataset
export const demoScene = async ({ gaussians = 5000, views = 16, size = '320x240', photos = true } = {}) => {
  const folder = path.join(temporaryFolder(), 'demo');
  await run('demo-scene', '--out', folder, '--gaussians', gaussians, '--views', views, '--size', size, ...(photos ? ['--render'] : []));
  const drag = (name) => ({ ...JSON.parse(readFileSync(path.join(folder, 'drags', `${name}.json`), 'utf8')), preset: 'preview' });
  return { folder, ply: await readFile(path.join(folder, 'scene.ply')), ball: drag('ball'), leaf: drag('leaf') };
};

/// Zip of a capture: the folders `sparse` and `images` below a folder, if they are there.
///   photo  bytes to stand for every photo
export const datasetZip = async (folder, { photo } = {}) => {
  const entries = [];
  const add = async (below) => {
    for (const item of await readdir(path.join(folder, below), { withFileTypes: true })) {
      const name = `${below}/${item.name}`;
      if (item.isDirectory()) await add(name);
      else entries.push({ name, bytes: (below === 'images' && photo) || await readFile(path.join(folder, name)) });
    }
  };
  await add('sparse');
  if (existsSync(path.join(folder, 'images'))) await add('images');
  return zip(entries);
};

/// What `splatdrag edit` makes of a request: the bytes of its scene.
export const editedByCommandLine = async (scene, dataset, request) => {
  const folder = temporaryFolder();
  const { scene: _, version: __, ...plain } = request;
  await writeFile(path.join(folder, 'request.json'), JSON.stringify(plain));
  await run('edit', '--scene', scene, ...(dataset ? ['--dataset', dataset] : []), '--request', path.join(folder, 'request.json'),
    '--out', path.join(folder, 'out'), '--pictures', '0');
  return readFile(path.join(folder, 'out', 'scene.ply'));
};

/// A single scene of the shared data, without cameras: {bytes}; or why the test has to be skipped.
export const single = (name) => {
  const file = path.join(data, 'scenes', name);
  return existsSync(file) ? { bytes: readFileSync(file) } : { absent: `${file} is absent: the shared data is not on this machine` };
};

const data = process.env.SPLATDRAG_DATA ?? path.join(root, '../shared/data');
/// The capture of the fox: {folder, ply, drags}; or why the test has to be skipped. In CI its absence is an error.
export const fox = () => {
  const folder = path.join(data, 'fox');
  if (existsSync(folder))
    return { folder, ply: readFileSync(path.join(folder, 'point_cloud.ply')), drags: JSON.parse(readFileSync(path.join(folder, 'drags.json'), 'utf8')) };
  if (process.env.CI) throw new Error(`${folder} is absent in CI`);
  return { absent: `${folder} is absent: the shared data is not on this machine` };
};
