// The sources of the page are sent without comments and indentation (server/service/page_text.h): no text in them may depend on
// either.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";

const web = new URL("../../../web/", import.meta.url);

test("no text of the page's sources goes over several lines, and no comment shares a line with code", () => {
  const sources = readdirSync(web).filter((name) => /\.(js|css)$/.test(name));
  assert.ok(sources.length > 20);
  for (const name of sources)
    readFileSync(new URL(name, web), "utf8")
      .split("\n")
      .forEach((line, i) => {
        const where = `${name}:${i + 1}: ${line}`;
        assert.equal((line.match(/`/g) ?? []).length % 2, 0, where);
        assert.ok(!line.endsWith("\\"), where);
        assert.ok(!/\*\/\s*\S/.test(line), where);
        assert.ok(!/\S.*\/\*/.test(line.replace(/^ *\/\*\*?/, "")), where);
      });
});
