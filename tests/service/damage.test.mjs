// What a disk may do to a data folder, as users of the service meet it: damage is named, and nothing damaged is served.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, readFileSync, rmSync, truncateSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { Service, program } from './support/program.mjs';
import { demoScene } from './support/scenes.mjs';

const flip = (file, bit) => {
  const bytes = readFileSync(file);
  bytes[bit >> 3] ^= 1 << (bit & 7);
  writeFileSync(file, bytes);
};

/// `splatdrag admin COMMAND`: its exit status and what it prints.
const admin = (command, folder) => {
  try {
    return { status: 0, out: execFileSync(program, ['admin', command, '--data', folder], { encoding: 'utf8', stdio: 'pipe' }) };
  } catch (error) {
    return { status: error.status, out: error.stdout };
  }
};

describe('damage of the data folder', () => {
  let demo, service, client, scene, first;
  const file = (name) => path.join(service.dataDir, name);
  const restart = async () => {
    await service.start();
    client = service.client;
  };
  before(async () => {
    demo = await demoScene({ gaussians: 5_000, views: 6, size: '160x120', photos: false });
    service = await Service.start();
    client = service.client;
    scene = await client.upload(demo.ply, { name: 'demo' });
    first = await client.succeeded((await client.submit({ scene: scene.id, ...demo.leaf, preset: 'preview' })).id);
  });
  after(() => service.stop());

  test('a bit of a scene\'s file: its name, and no bytes under its ETag', async () => {
    const url = `/v1/scenes/${scene.id}/versions/0/file`;
    const { etag } = (await client.get(url)).headers;
    await service.stop();
    const base = file(`scenes/${scene.id}/base.ply`), whole = readFileSync(base);
    flip(base, 8 * (whole.length - 10));
    const checked = admin('check', service.dataDir);
    assert.equal(checked.status, 4);
    assert.match(checked.out, new RegExp(`^scenes/${scene.id}/base.ply: `));
    await restart();
    for (const headers of [{}, { 'if-range': etag, range: 'bytes=0-99' }]) {
      const refused = (await client.request('GET', url, { headers, expect: 422 })).json();
      assert.equal(refused.code, 'corrupt_data');
      assert.equal(refused.where, `scenes/${scene.id}/base.ply`);
    }
    await client.get(`/v1/scenes/${scene.id}/versions/1/file`, { expect: 422 });
    await client.get(`/v1/scenes/${scene.id}`);
    writeFileSync(base, whole);
    await client.file(scene.id, 0);
    await client.file(scene.id, 1);
  });

  test('an empty counter of scenes: the service starts, and no id is used again', async () => {
    await service.stop();
    truncateSync(file('scenes/next_scene'));
    await restart();
    assert.match(service.log, /number of the next scene/);
    const added = await client.upload(demo.ply, { name: 'second' });
    assert.ok(added.id > scene.id);
    await client.delete(`/v1/scenes/${added.id}`);
  });

  test('a log of records that ends early: accepted edits are found again', async () => {
    const { id } = await client.submit({ scene: scene.id, ...demo.leaf, preset: 'preview' }, { 'idempotency-key': 'once' });
    await service.kill();
    truncateSync(file('edits/jobs.db-wal'));
    await restart();
    const edit = await client.succeeded(id);
    assert.equal(edit.scene, scene.id);
    const again = await client.submit({ scene: scene.id, ...demo.leaf, preset: 'preview' }, { 'idempotency-key': 'once' });
    assert.equal(again.id, id);
  });

  test('no records at all: the service says how to go on, and nothing is lost', async () => {
    await service.stop();
    rmSync(file('edits/jobs.db'));
    await assert.rejects(service.start(), /splatdrag admin rebuild/);
    assert.ok(!existsSync(file('edits/jobs.db')), 'it began afresh');
    assert.equal(admin('rebuild', service.dataDir).status, 0);
    assert.equal(admin('check', service.dataDir).status, 0);
    await restart();
    const edit = await client.edit(first.id);
    assert.equal(edit.state, 'succeeded');
    assert.equal(edit.result_version, first.result_version);
  });
});
