// A drag on a scene of each format that people hold: the edited scene comes back in the format it came in.
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { summary } from './support/contract.mjs';
import { Service, root } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const formats = ['ply', 'compressed_ply', 'splat', 'spz', 'sog', 'glb'];
const extensions = { compressed_ply: 'compressed.ply' };

let demo, service, client, first;
before(async () => {
  demo = await demoScene({ views: 4, photos: false });
  service = await Service.start();
  client = service.client;
  first = await client.upload(demo.ply, { name: 'demo' });
});
after(async () => {
  console.log(`${summary()}`);
  await service?.stop();
});

/// Sends a file, drags in it, and gives the scene, the file of version 1 in the scene's own format, and its answer's name.
const dragged = async (bytes, request) => {
  const scene = await client.upload(bytes);
  const edit = await client.succeeded((await client.submit({ scene: scene.id, ...request })).id);
  assert.equal(edit.result_version, 1);
  const answer = await client.get(`/v1/scenes/${scene.id}/versions/1/file`, { query: { format: 'original' } });
  return { scene, file: answer.body, named: answer.headers['content-disposition'] };
};

describe('the demo scene, converted by the service', () => {
  for (const format of formats)
    test(format, async () => {
      const { scene, file, named } = await dragged(await client.file(first.id, 0, format), demo.ball);
      assert.equal(scene.format, format);
      assert.equal(scene.gaussians, first.gaussians);
      assert.ok(named.includes(`.${extensions[format] ?? format}"`), named);
      const back = await client.upload(file);
      const { gaussians } = (await client.get(`/v1/scenes/${scene.id}`)).json().versions[1];
      assert.deepEqual([back.format, back.gaussians], [format, gaussians]);
      const ply = await client.file(scene.id, 1);
      assert.ok(!ply.equals(await client.file(scene.id, 0)), 'the drag changed nothing');
      await client.delete(`/v1/scenes/${back.id}`);
    });

  test('version 0 in its own format is the very file', async () => {
    for (const format of formats) {
      const bytes = await client.file(first.id, 0, format);
      const scene = await client.upload(bytes);
      assert.deepEqual(await client.file(scene.id, 0, 'original'), bytes, format);
      await client.delete(`/v1/scenes/${scene.id}`);
    }
  });

  test('another word than the formats is refused', async () => {
    const answer = await client.get(`/v1/scenes/${first.id}/versions/0/file`, { query: { format: 'ksplat' }, expect: 400 });
    assert.equal(answer.json().where, 'format');
  });
});

describe('zip files', () => {
  test('a dataset is no scene, and the answer says where it belongs', async () => {
    const answer = await client.request('POST', '/v1/scenes', {
      body: await datasetZip(demo.folder), headers: { 'content-type': 'application/octet-stream' }, expect: 422 });
    assert.match(answer.json().detail, /dataset/);
  });
  test('a scene is no dataset', async () => {
    await client.request('PUT', `/v1/scenes/${first.id}/dataset`, {
      body: await client.file(first.id, 0, 'sog'), headers: { 'content-type': 'application/zip' }, expect: [400, 404, 415, 422] });
  });
});

const there = path.join(process.env.SPLATDRAG_DATA ?? path.join(root, '../shared/data'), 'scenes/playbot');
describe('a trained scene, as another program wrote it', { skip: !existsSync(there) && !process.env.CI && `${there} is absent` }, () => {
  const files = { 'playbot_31k.ply': 'ply', 'playbot_31k.compressed.ply': 'compressed_ply', 'playbot_31k.sog': 'sog', 'playbot_31k.glb': 'glb',
    'playbot_31k.spz': 'spz', 'playbot_31k_v3.spz': 'spz', 'spz-ext/v3_with_trailer.spz': 'spz', 'spz-ext/v4_declares_rub.spz': 'spz' };
  const results = {};
  for (const [name, format] of Object.entries(files))
    test(name, async () => {
      const sent = readFileSync(path.join(there, name));
      const centre = [0, -0.4, 0];
      const { scene, file } = await dragged(sent, { preset: 'preview', handles: [{ source: centre, target: [0.3, -0.4, 0], radius: 0.2 }] });
      assert.deepEqual([scene.format, scene.gaussians], [format, 31_000]);
      const back = await client.upload(file);
      assert.equal(back.format, format);
      results[name] = { gaussians: back.gaussians, bounds: back.bounds };
      if (format === 'spz') assert.deepEqual(file.subarray(0, 2), sent.subarray(0, 2), 'gzip stays gzip: the version');
      await client.delete(`/v1/scenes/${back.id}`);
    });
  test('the drag did the same in all of them', () => {
    const of = Object.values(results);
    assert.equal(of.length, Object.keys(files).length);
    for (const { gaussians, bounds } of of) {
      assert.ok(Math.abs(gaussians - of[0].gaussians) < 0.01 * of[0].gaussians, `${gaussians} and ${of[0].gaussians} Gaussians`);
      for (const side of ['low', 'high'])
        for (const axis of [0, 1, 2]) assert.ok(Math.abs(bounds[side][axis] - of[0].bounds[side][axis]) < 0.01, `${side}[${axis}]`);
    }
  });
});
