// Selections over REST: what is meant, seen tinted, and dragged.
import assert from 'node:assert/strict';
import { writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { summary } from './support/contract.mjs';
import { run, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene, editedByCommandLine } from './support/scenes.mjs';

const look = { eye: [0.3, -1.5, -4], target: [0, -0.3, 0], width: 320, height: 240 };
const inQuery = { eye: look.eye.join(), target: look.target.join(), width: 320, height: 240, format: 'png' };

let demo, service, client, scene, ball, version;
before(async () => {
  demo = await demoScene();
  service = await Service.start();
  client = service.client;
  scene = await client.upload(demo.ply, { name: 'demo' });
  await client.putDataset(scene.id, await datasetZip(demo.folder));
  const [handle] = demo.ball.handles;
  ball = { center: handle.source, radius: handle.radius };
  version = `/v1/scenes/${scene.id}/versions/0`;
});
after(async () => {
  console.log(`${summary()}`);
  await service?.stop();
});

const select = async (selection, options) => (await client.post(`${version}/select`, { selection }, options)).json();

describe('a selection', () => {
  test('says what it holds, and has the same id again', async () => {
    const selected = await select([{ sphere: ball }]);
    const picked = (await client.post(`${version}/pick`, { point: ball.center, radius: ball.radius })).json();
    assert.equal(selected.count, picked.gaussians_in_radius);
    assert.ok(selected.count > 100);
    for (let axis = 0; axis < 3; ++axis) {
      assert.ok(Math.abs(selected.centre[axis] - ball.center[axis]) < ball.radius);
      assert.ok(selected.bounds.low[axis] >= ball.center[axis] - ball.radius && selected.bounds.high[axis] <= ball.center[axis] + ball.radius);
    }
    assert.deepEqual(await select([{ sphere: ball }]), selected);
    assert.deepEqual(selected.warnings, []);
  });

  test('is made step by step', async () => {
    const all = scene.gaussians;
    const count = async (...selection) => (await select(selection)).count;
    const sphere = await count({ sphere: ball });
    assert.equal(await count({ invert: true }), all);
    assert.equal(await count({ invert: true }, { op: 'subtract', sphere: ball }), all - sphere);
    assert.equal(await count({ rows: [[0, 10], [5, 20]] }), 20);
    assert.equal(await count({ sphere: ball }, { op: 'intersect', plane: { point: ball.center, normal: [0, -1, 0] } })
      + await count({ sphere: ball }, { op: 'intersect', plane: { point: ball.center, normal: [0, 1, 0] } }), sphere);
    assert.ok(await count({ sphere: ball }, { expand: 0.2 }) > sphere);
    assert.deepEqual((await select([])).warnings, ['nothing is selected']);
  });

  test('grows from clicks', async () => {
    const at = (await client.post(`${version}/pick`, { view: 'view_00.png', x: 160, y: 120 })).json();
    assert.ok(at.hit);
    const grown = await select([{ grow: { inside: [ball.center], outside: [at.point] } }]);
    assert.ok(grown.count > 10 && grown.count < scene.gaussians, `${grown.count}`);
  });

  test('is lifted from masks of views', async () => {
    const { views } = (await client.get(`/v1/scenes/${scene.id}/views`)).json();
    const masks = await Promise.all(views.slice(0, 2).map(async ({ name }) => ({
      view: name, image: (await client.get(`${version}/render`, { query: { view: name, what: 'alpha', format: 'png' } })).body.toString('base64') })));
    const lifted = await select([{ masks }]);
    assert.ok(lifted.count > scene.gaussians / 10, `${lifted.count}`);
    const wrong = await client.post(`${version}/select`, { selection: [{ masks: [{ ...masks[0], view: undefined, camera: look, image: masks[0].image.slice(0, 400) }] }] },
      { expect: [400, 422] });
    assert.equal(wrong.json().where, 'selection[0].masks[0].image');
  });

  test('is tinted in pictures', async () => {
    const { id } = await select([{ sphere: ball }]);
    const plain = await client.get(`${version}/render`, { query: inQuery });
    const tinted = await client.get(`${version}/render`, { query: { ...inQuery, selection: id } });
    assert.notEqual(tinted.headers.etag, plain.headers.etag);
    assert.ok(!tinted.body.equals(plain.body));
    await client.get(`${version}/render`, { query: { ...inQuery, selection: id }, headers: { 'if-none-match': tinted.headers.etag }, expect: 304 });
    const posted = await client.post(`${version}/render`, { camera: look, format: 'png', selection: id });
    assert.ok(posted.body.equals(tinted.body));
    const none = (await select([])).id;
    assert.ok((await client.get(`${version}/render`, { query: { ...inQuery, selection: none } })).body.equals(plain.body));
  });

  test('that is not kept is a 404 that says what to do', async () => {
    const lost = await client.get(`${version}/render`, { query: { ...inQuery, selection: 'q0123456789abcdef' }, expect: 404 });
    assert.equal(lost.json().where, 'selection');
    assert.match(lost.json().detail, /post it again/);
  });

  test('that is wrong or too much is refused with its address', async () => {
    const refused = async (selection, where, expect = 400) =>
      assert.equal((await client.request('POST', `${version}/select`, { json: { selection }, expect })).json().where, where);
    await refused(Array.from({ length: 10_000 }, () => ({ invert: true })), 'selection');
    await refused([{ invert: true }, { grow: { inside: [[0, 0, 0], [0, 1e30, 0]] } }], 'selection[1].grow.inside[1][1]');
    await refused([{ grow: { inside: [ball.center, [0, 1e6, 0]], reach: 2 } }], 'selection[0].grow.inside[1]', 422);
    await refused([{ sphere: { center: [0, 0, 'NaN'], radius: 1 } }], 'selection[0].sphere.center[2]');
    await refused([{ sphere: { ...ball, colour: {} } }], 'selection[0].sphere.colour');
    await refused([{ sphere: ball, invert: true }], 'selection[0]');
    await refused([{ rows: [[0, scene.gaussians + 1]] }], 'selection[0].rows[0]', 422);
    await refused([{ polygon: { view: 'nowhere', points: [[0, 0], [1, 0], [0, 1]] } }], 'selection[0].polygon.view', 404);
    let nested = [];
    for (let i = 0; i < 40; ++i) nested = [nested];
    await client.request('POST', `${version}/select`, { json: { selection: nested }, expect: 413 });
    const many = Buffer.from(`{"selection":[{"rows":[${'[0,1],'.repeat(200_000)}[0,1]]}]}`);
    await client.request('POST', `${version}/select`, { body: many, headers: { 'content-type': 'application/json' }, expect: 413 });
    await service.alive();
  });
});

describe('an edit', () => {
  const request = (selection, more = {}) => {
    const [{ source, target, group }] = demo.ball.handles;
    return { ...demo.ball, region: undefined, scene: scene.id, handles: [{ source, target, group }], selection, ...more };
  };

  test('moves what is selected, as the command line does', async () => {
    const asked = request([{ sphere: ball }, { op: 'subtract', stroke: { view: 'view_00.png', points: [[0, 0], [40, 0]], radius: 5 } }]);
    const estimate = (await client.post('/v1/edits?validate_only=true', asked)).json();
    const { count } = await select(asked.selection);
    assert.equal(estimate.handles[0].gaussians, count);
    assert.ok(estimate.request.handles[0].radius > 0);
    const preview = (await client.post('/v1/previews', asked)).json();
    assert.equal(preview.handles[0].gaussians, count);
    const edit = await client.succeeded((await client.submit(asked)).id);
    assert.equal(edit.handles[0].gaussians, count);
    assert.deepEqual(edit.request.selection.length, 2);
    assert.ok((await client.file(scene.id, edit.result_version)).equals(
      await editedByCommandLine(path.join(demo.folder, 'scene.ply'), demo.folder, asked)));
  });

  test('removes what is selected, without a handle', async () => {
    const asked = { scene: scene.id, version: 0, preset: 'preview', mode: 'remove', selection: [{ sphere: ball }] };
    const { count } = await select(asked.selection);
    const edit = await client.succeeded((await client.submit(asked)).id);
    assert.deepEqual(edit.request.handles, []);
    assert.deepEqual(edit.request.selection, asked.selection);
    assert.ok(edit.gaussians.removed >= count);
    assert.equal(edit.gaussians.output, scene.gaussians - edit.gaussians.removed);
    assert.ok(edit.result_version >= 1 && edit.timings.length > 0);
    await client.file(scene.id, edit.result_version);
  });

  test('goes on to the same bytes after a kill', async () => {
    const asked = request([{ sphere: ball }], { params: { intervals: 8, views: 12, max_image_side: 320 } });
    const whole = await client.succeeded((await client.submit(asked)).id);
    const { id } = await client.submit(asked);
    await client.until(id, ({ finished_intervals: finished }) => finished.length > 0);
    await service.kill();
    await service.start();
    client = service.client;
    const resumed = await client.succeeded(id);
    assert.deepEqual(resumed.request, whole.request);
    assert.ok((await client.file(scene.id, resumed.result_version)).equals(await client.file(scene.id, whole.result_version)));
  });

  test('of nothing is refused, and a handle beside what is selected too', async () => {
    const where = async (asked) => (await client.post('/v1/edits', asked, { expect: 422 })).json().where;
    assert.equal(await where(request([])), 'selection');
    const [handle] = request([]).handles;
    assert.equal(await where(request([{ sphere: ball }], { handles: [handle, { source: [90, 0, 0], target: [91, 0, 0] }] })), 'handles[1].source');
    const missing = (await client.post('/v1/edits', request(undefined), { expect: 400 })).json();
    assert.equal(missing.where, 'handles[0].radius');
  });
});

describe('splatdrag select', () => {
  test('tells what the service tells, and writes it', async () => {
    const folder = temporaryFolder();
    const selection = [{ sphere: ball }, { op: 'subtract', stroke: { view: 'view_00.png', points: [[160, 120]], radius: 10 } }];
    await writeFile(path.join(folder, 'selection.json'), JSON.stringify({ selection }));
    const args = ['--selection', path.join(folder, 'selection.json')];
    const { stdout } = await run('select', path.join(demo.folder, 'scene.ply'), ...args, '--dataset', demo.folder,
      '--out', path.join(folder, 'part.ply'), '--pictures', path.join(folder, 'pictures'), '--views', 2);
    const { count } = await select(selection);
    assert.match(stdout, new RegExp(`^${count} of ${scene.gaussians} Gaussians`));
    assert.equal(stdout.match(/selected_.*\.png/g).length, 2);
    assert.match((await run('info', '--scene', path.join(folder, 'part.ply'))).stdout, new RegExp(`\\b${count}\\b`));
    await assert.rejects(run('select', path.join(demo.folder, 'scene.ply'), ...args), /selection\.json:selection\[1\]\.stroke\.view/);
  });
});
