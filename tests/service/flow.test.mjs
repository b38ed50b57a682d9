// The whole way over REST, from the upload to the download, on the demo scene and on a real capture.
import assert from 'node:assert/strict';
import { cp, mkdir, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { finalStates } from './support/client.mjs';
import { operations, summary, timesSeen } from './support/contract.mjs';
import { form, formType } from './support/form.mjs';
import { Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene, editedByCommandLine, fox } from './support/scenes.mjs';

const look = { eye: [0.3, -1.5, -4], target: [0, -0.3, 0], width: 320, height: 240 };
const pictureTypes = { jpeg: 'image/jpeg', png: 'image/png', exr: 'image/x-exr' };
const magic = { jpeg: 'ffd8ff', png: '89504e47', exr: '762f3101' };
/// Width and height of a PNG.
const pngSize = (bytes) => [bytes.readUInt32BE(16), bytes.readUInt32BE(20)];

let demo, zipped, root, service, client;
before(async () => {
  demo = await demoScene();
  zipped = await datasetZip(demo.folder);
  root = temporaryFolder();
  await mkdir(path.join(root, 'captures'));
  await cp(demo.folder, path.join(root, 'captures', 'demo'), { recursive: true });
  service = await Service.start({ args: ['--scene-root', root] });
  client = service.client;
});
after(async () => {
  console.log(`${summary()}`);
  await service?.stop();
});

let scene;  // the demo scene, with its dataset, for all that follows
describe('a scene', () => {
  test('comes as a raw body, as a form or by path, and is the same', async () => {
    scene = await client.upload(demo.ply, { name: 'demo' });
    const byForm = (await client.request('POST', '/v1/scenes', {
      body: form([{ name: 'file', filename: 'my scene.ply', bytes: demo.ply }]), headers: { 'content-type': formType }, expect: 201 })).json();
    const byPath = (await client.post('/v1/scenes', { path: 'captures/demo/scene.ply', name: 'by path' }, { expect: 201 })).json();
    assert.deepEqual([scene.name, byForm.name, byPath.name], ['demo', 'my scene', 'by path']);
    for (const other of [byForm, byPath]) {
      for (const field of ['format', 'gaussians', 'sh_degree', 'bounds', 'centre', 'radius']) assert.deepEqual(other[field], scene[field], field);
      assert.deepEqual(await client.file(other.id, 0), demo.ply);
      await client.delete(`/v1/scenes/${other.id}`);
      await client.get(`/v1/scenes/${other.id}`, { expect: 404 });
    }
    assert.equal(scene.format, 'ply');
    assert.equal(scene.versions.length, 1);
    assert.equal(scene.versions[0].gaussians, scene.gaussians);
  });

  test('is found under its Location and in the list', async () => {
    const response = await client.request('POST', '/v1/scenes', { body: demo.ply, headers: { 'content-type': 'application/octet-stream' }, expect: 201 });
    const added = response.json();
    assert.equal(response.headers.location, `/v1/scenes/${added.id}`);
    assert.equal((await client.get(response.headers.location)).json().id, added.id);
    const ids = (await client.get('/v1/scenes')).json().scenes.map(({ id }) => id);
    assert.deepEqual(ids, [scene.id, added.id]);
    await client.delete(response.headers.location);
  });

  test('has virtual views until it gets a dataset, and then those of the dataset', async () => {
    const virtual = (await client.get(`/v1/scenes/${scene.id}/views`)).json();
    assert.equal(virtual.kind, 'virtual');
    assert.equal(virtual.views.length, scene.views);
    const withDataset = await client.putDataset(scene.id, zipped);
    assert.equal(withDataset.dataset.kind, 'colmap');
    assert.equal(withDataset.dataset.photos, 16);
    assert.ok(withDataset.dataset.psnr_mean_db > 40, `the photos are renders, yet PSNR is ${withDataset.dataset.psnr_mean_db}`);
    assert.ok(withDataset.dataset.psnr_worst_db <= withDataset.dataset.psnr_mean_db);
    assert.deepEqual(withDataset.dataset.warnings, []);
    const views = (await client.get(`/v1/scenes/${scene.id}/views`)).json();
    assert.equal(views.kind, 'dataset');
    assert.equal(views.views.length, 16);
    assert.ok(views.views.every((view) => view.photo && view.width === 320 && view.height === 240));
  });

  test('shows the photos of its dataset, and can do without it', async () => {
    const other = await client.upload(demo.ply, { name: 'with photos' });
    await client.putDataset(other.id, zipped);
    const query = { view: 'view_03.png', max_side: 160 };
    const photo = await client.get(`/v1/scenes/${other.id}/photo`, { query });
    assert.equal(photo.body.subarray(0, 3).toString('hex'), magic.jpeg);
    await client.get(`/v1/scenes/${other.id}/photo`, { query, headers: { 'if-none-match': photo.headers.etag }, expect: 304 });
    await client.get(`/v1/scenes/${other.id}/photo`, { query: { view: 'elsewhere.png' }, expect: 404 });
    const without = (await client.request('DELETE', `/v1/scenes/${other.id}/dataset`, { expect: 200 })).json();
    assert.equal(without.dataset, null);
    assert.equal((await client.get(`/v1/scenes/${other.id}/views`)).json().kind, 'virtual');
    await client.request('DELETE', `/v1/scenes/${other.id}/dataset`, { expect: 404 });
    await client.delete(`/v1/scenes/${other.id}`);
  });

  test('tells all who follow it what happens to it, until it is gone', async () => {
    const other = await client.upload(demo.ply, { name: 'followed' });
    let edit = null;
    const events = await client.sceneEvents(other.id, async ({ event, data }) => {
      if (event === 'scene' && data.versions.length === 1 && data.versions[0].name === null) {
        const named = await client.request('PATCH', `/v1/scenes/${other.id}/versions/0`, { json: { name: 'as it came' }, expect: 200 });
        assert.equal(named.json().name, 'as it came');
        edit = (await client.submit({ ...demo.ball, scene: other.id })).id;
      }
      if (event === 'edit' && data.state === 'succeeded') await client.delete(`/v1/scenes/${other.id}`);
    });
    const kinds = events.map(({ event }) => event);
    assert.equal(kinds.at(-1), 'gone');
    const last = events.findLast(({ event }) => event === 'scene').data;
    assert.deepEqual([last.versions[0].name, last.versions[1].edit], ['as it came', edit]);
    const end = events.findIndex(({ event, data }) => event === 'edit' && data.state === 'succeeded');
    assert.ok(events.findIndex(({ event, data }) => event === 'scene' && data.versions.length === 2) < end, 'the version before its edit');
    await client.delete(`/v1/edits/${edit}`);
  });

  test('takes its dataset by path or as a form too, and warns when photos do not fit', async () => {
    const byPath = (await client.request('PUT', `/v1/scenes/${scene.id}/dataset`, { json: { path: 'captures/demo' }, expect: 200 })).json();
    assert.equal(byPath.dataset.views, 16);
    const other = await client.upload(demo.ply, { name: 'other' });
    const put = async (photos) => (await client.request('PUT', `/v1/scenes/${other.id}/dataset`,
      { body: form([{ name: 'file', filename: 'demo.zip', bytes: photos }]), headers: { 'content-type': formType }, expect: 200 })).json().dataset;
    assert.deepEqual(await put(zipped), byPath.dataset);
    const nowhere = { eye: '0,-1,-4', target: '0,-1,-8', width: 320, height: 240, background: '1,1,1', format: 'png' };
    const { body: white } = await client.get(`/v1/scenes/${other.id}/versions/0/render`, { query: nowhere });
    const misfit = await put(await datasetZip(demo.folder, { photo: white }));
    assert.ok(misfit.psnr_mean_db < 15, `PSNR ${misfit.psnr_mean_db}`);
    assert.match(misfit.warnings.join(), /dB/);
    await client.delete(`/v1/scenes/${other.id}`);
  });

  test('can be renamed and told which way is up', async () => {
    const changed = (await client.request('PATCH', `/v1/scenes/${scene.id}`, { json: { name: 'renamed', up: [0, 0, 1] }, expect: 200 })).json();
    assert.deepEqual([changed.name, changed.up], ['renamed', [0, 0, 1]]);
    const onlyName = (await client.request('PATCH', `/v1/scenes/${scene.id}`, { json: { name: 'demo' }, expect: 200 })).json();
    assert.deepEqual([onlyName.name, onlyName.up], ['demo', [0, 0, 1]]);
    const forgotten = (await client.request('PATCH', `/v1/scenes/${scene.id}`, { json: { up: null }, expect: 200 })).json();
    assert.equal(forgotten.up, null);
  });
});

describe('a picture', () => {
  const render = (query, options) => client.get(`/v1/scenes/${scene.id}/versions/0/render`, { query, ...options });

  test('comes in every format and of everything there is to see', async () => {
    for (const what of ['color', 'depth', 'alpha', 'mask'])
      for (const format of ['png', 'jpeg', 'exr']) {
        const { headers, body } = await render({ view: 'view_03.png', what, format });
        assert.equal(headers['content-type'], pictureTypes[format], `${what} as ${format}`);
        assert.equal(body.subarray(0, magic[format].length / 2).toString('hex'), magic[format], `${what} as ${format}`);
        assert.match(headers['server-timing'], /render;dur=[\d.]+, *encode;dur=[\d.]+/);
      }
  });

  test('comes as Accept asks', async () => {
    for (const type of Object.values(pictureTypes))
      assert.equal((await render({ view: 'view_00.png' }, { headers: { accept: type } })).headers['content-type'], type);
    assert.equal((await render({ view: 'view_00.png' }, { headers: { accept: 'image/avif,image/webp,*/*;q=0.8' } })).headers['content-type'], 'image/jpeg');
    assert.equal((await render({ view: 'view_00.png' }, { headers: { accept: 'text/html' }, expect: 406 })).status, 406);
  });

  test('is the same through a view, its camera and the query', async () => {
    const view = (await client.get(`/v1/scenes/${scene.id}/views`)).json().views.find(({ name }) => name === 'view_05.png');
    const { name, photo, ...camera } = view;
    const byName = await render({ view: name, format: 'png' });
    const byCamera = await client.post(`/v1/scenes/${scene.id}/versions/0/render`, { camera, format: 'png' });
    const byPost = await client.post(`/v1/scenes/${scene.id}/versions/0/render`, { view: name, format: 'png' });
    assert.ok(photo);
    assert.deepEqual(byCamera.body, byName.body);
    assert.deepEqual(byPost.body, byName.body);
    const query = { eye: look.eye.join(), target: look.target.join(), width: look.width, height: look.height, fov: 40, format: 'png' };
    const { width, height, eye, target } = look;
    const posted = await client.post(`/v1/scenes/${scene.id}/versions/0/render`, { camera: { eye, target, width, height, fov_y_deg: 40 }, format: 'png' });
    assert.deepEqual((await render(query)).body, posted.body);
  });

  test('obeys size, background, quality and SH degree', async () => {
    const png = async (query) => (await render({ view: 'view_00.png', format: 'png', ...query })).body;
    assert.deepEqual(pngSize(await png({})), [320, 240]);
    assert.deepEqual(pngSize(await png({ max_side: 160 })), [160, 120]);
    const nowhere = { eye: '0,-1,-4', target: '0,-1,-8', width: 32, height: 24, format: 'png' };
    const empty = async (background) => (await render({ ...nowhere, background })).body;
    assert.notDeepEqual(await empty('1,0,0'), await empty('0,0,1'));
    const small = (await render({ view: 'view_00.png', quality: 20 })).body, large = (await render({ view: 'view_00.png', quality: 95 })).body;
    assert.ok(small.length < large.length);
    await png({ sh_degree: 0 });
  });

  test('is not sent again to who has it', async () => {
    const first = await render({ view: 'view_01.png' });
    const again = await render({ view: 'view_01.png' }, { headers: { 'if-none-match': first.headers.etag }, expect: 304 });
    assert.equal(again.headers.etag, first.headers.etag);
    await render({ view: 'view_01.png' }, { headers: { 'if-none-match': `"x", W/${first.headers.etag}` }, expect: 304 });
    await render({ view: 'view_01.png' }, { headers: { 'if-none-match': '"other"' }, expect: 200 });
    const other = await render({ view: 'view_02.png' });
    assert.notEqual(other.headers.etag, first.headers.etag);
  });
});

describe('a pick', () => {
  const pick = async (version, body) => (await client.post(`/v1/scenes/${scene.id}/versions/${version}/pick`, body)).json();

  test('selects what a pick counts', async () => {
    const [{ source: center, radius }] = demo.ball.handles;
    const selected = (await client.post(`/v1/scenes/${scene.id}/versions/0/select`, { selection: [{ sphere: { center, radius } }] })).json();
    assert.equal(selected.count, (await pick(0, { point: center, radius })).gaussians_in_radius);
  });

  test('finds the surface under a pixel, and counts around it', async () => {
    const view = (await client.get(`/v1/scenes/${scene.id}/views`)).json().views[0];
    const hit = await pick(0, { view: view.name, x: 160.5, y: 140.5, radius: 0.3 });
    assert.equal(hit.hit, true);
    const [x, y, z] = view.cam_from_world.map((row) => row[0] * hit.point[0] + row[1] * hit.point[1] + row[2] * hit.point[2] + row[3]);
    assert.ok(Math.abs(view.fx * x / z + view.cx - 160.5) < 0.01 && Math.abs(view.fy * y / z + view.cy - 140.5) < 0.01, 'the point lies under the pixel');
    assert.ok(Math.abs(z - hit.depth) < 1e-3 * z);
    assert.ok(hit.gaussian >= 0 && hit.gaussian < scene.gaussians);
    assert.equal((await pick(0, { point: hit.point, radius: 0.3 })).gaussians_in_radius, hit.gaussians_in_radius);
    const { width, height, fx, fy, cx, cy, cam_from_world } = view;
    assert.deepEqual(await pick(0, { camera: { width, height, fx, fy, cx, cy, cam_from_world }, x: 160.5, y: 140.5, radius: 0.3 }), hit);
    assert.equal((await pick(0, { view: view.name, x: 160.5, y: 140.5 })).gaussians_in_radius, null);
  });

  test('of nothing is a miss', async () => {
    const miss = await pick(0, { camera: { eye: [0, -1, -4], target: [0, -1, -8], width: 64, height: 64 }, x: 32, y: 32 });
    assert.deepEqual(miss, { hit: false, point: null, depth: null, normal: null, gaussian: null, gaussians_in_radius: null });
  });

  test('counts as many Gaussians as the edit will take', async () => {
    const [handle] = demo.ball.handles;
    const { gaussians_in_radius: counted } = await pick(0, { point: handle.source, radius: handle.radius });
    const preview = (await client.post('/v1/previews', { scene: scene.id, ...demo.ball })).json();
    assert.equal(counted, preview.handles[0].gaussians);
  });
});

describe('a preview', () => {
  test('is a version like any other: rendered, picked, downloaded', async () => {
    const preview = (await client.post('/v1/previews', { scene: scene.id, version: 0, ...demo.ball })).json();
    assert.equal(preview.scene, scene.id);
    assert.equal(preview.parent, 0);
    assert.equal(preview.gaussians.input, scene.gaussians);
    assert.ok(preview.handles[0].gaussians > 0);
    preview.handles[0].position.forEach((value, axis) => assert.ok(Math.abs(value - demo.ball.handles[0].target[axis]) < 0.05));
    const query = { view: 'view_12.png', format: 'png' };
    const before = await client.get(`/v1/scenes/${scene.id}/versions/0/render`, { query });
    const moved = await client.get(preview.links.render, { query });
    assert.notDeepEqual(moved.body, before.body);
    const masked = await client.get(preview.links.render, { query: { ...query, what: 'mask' } });
    const unmasked = await client.get(`/v1/scenes/${scene.id}/versions/0/render`, { query: { ...query, what: 'mask' } });
    assert.notDeepEqual(masked.body, unmasked.body);
    const there = (await client.post(preview.links.pick, { point: demo.ball.handles[0].target, radius: demo.ball.handles[0].radius })).json();
    assert.ok(there.gaussians_in_radius >= preview.handles[0].gaussians / 2);
    assert.ok((await client.get(preview.links.file)).body.length > demo.ply.length / 2);
    const after = (await client.get(`/v1/scenes/${scene.id}`)).json();
    assert.equal(after.versions.length, 1, 'a preview makes no version');
  });

  test('deforms as the edit does', async () => {
    const request = { scene: scene.id, ...demo.leaf };
    const preview = (await client.post('/v1/previews', request)).json();
    const counts = (await client.request('POST', '/v1/edits', { query: { validate_only: 'true' }, json: request, expect: 200 })).json();
    assert.deepEqual(counts.handles, preview.handles.map(({ gaussians }) => ({ gaussians })));
    assert.equal(counts.request.scene ?? scene.id, scene.id);
  });
});

describe('an edit', () => {
  let first;  // the finished edit that later tests build on

  test('can be checked and estimated without being queued', async () => {
    const estimate = (await client.request('POST', '/v1/edits', { query: { validate_only: 'true' }, json: { scene: scene.id, ...demo.ball }, expect: 200 })).json();
    assert.ok(estimate.handles[0].gaussians > 0 && estimate.views > 0 && estimate.intervals >= 1);
    assert.ok(estimate.estimate.seconds > 0 && estimate.estimate.memory_bytes > 0);
    assert.deepEqual((await client.get('/v1/edits')).json().edits, []);
  });

  test('runs to its result, which is what the command line makes of the same request', async () => {
    const request = { scene: scene.id, ...demo.ball };
    const response = await client.request('POST', '/v1/edits', { json: request, expect: 202 });
    const accepted = response.json();
    assert.equal(response.headers.location, `/v1/edits/${accepted.id}`);
    assert.equal(response.headers['retry-after'], '1');
    first = await client.succeeded(accepted.id);
    assert.equal(first.progress, 1);
    assert.equal(first.result_version, 1);
    assert.equal(first.intervals, first.finished_intervals.length);
    assert.ok(first.started >= first.created && first.ended >= first.started);
    assert.ok(first.simd && first.timings.length > 0);
    assert.ok(first.request.params.intervals >= 1, 'the request is resolved');
    const [version] = (await client.get(`/v1/scenes/${scene.id}`)).json().versions.slice(1);
    assert.deepEqual([version.version, version.parent, version.edit, version.gaussians], [1, 0, first.id, first.gaussians.output]);
    const file = (await client.get(first.links.file)).body;
    assert.deepEqual(file, await editedByCommandLine(path.join(demo.folder, 'scene.ply'), demo.folder, request));
    assert.deepEqual(await client.file(scene.id, 0), demo.ply, 'undo: version 0 is the file that was uploaded');
  });

  test('shows pictures of each interval', async () => {
    let pictures = 0;
    for (const interval of first.finished_intervals)
      for (const { view, stages } of interval.renders) {
        assert.ok(view);
        assert.ok(stages.before && stages.deformed);
        for (const link of Object.values(stages)) {
          const picture = await client.get(link);
          assert.equal(picture.body.subarray(0, 3).toString('hex'), magic.jpeg);
          if (++pictures === 1) await client.get(link, { headers: { 'if-none-match': picture.headers.etag }, expect: 304 });
        }
      }
    assert.ok(pictures >= 2 * first.intervals);
    await client.get(`/v1/edits/${first.id}/intervals/99/renders/0`, { query: { stage: 'before' }, expect: 404 });
    await client.get(`/v1/edits/${first.id}/intervals/1/renders/99`, { query: { stage: 'before' }, expect: 404 });
  });

  test('asked for nothing special is corrected as well, tells so, and shows what it was corrected to', async () => {
    const { preset: _, ...plain } = demo.ball;
    const request = { scene: scene.id, ...plain, params: { intervals: 2, annealing_steps: 2, iterations: 10, views: 6, max_image_side: 160 } };
    const accepted = await client.submit(request);
    assert.equal(accepted.request.preset, 'standard');
    assert.equal(accepted.request.params.corrector, 'scene');
    const events = await client.events(accepted.id);
    assert.ok(events.some(({ edit }) => edit.stage === 'correct'), `${[...new Set(events.map(({ edit }) => edit.stage))]}`);
    events.slice(1).forEach(({ edit }, i) => assert.ok(edit.progress >= events[i].edit.progress, 'progress never falls'));
    const edit = events.at(-1).edit;
    assert.equal(edit.state, 'succeeded', JSON.stringify(edit.error));
    assert.deepEqual(edit.warnings, []);
    assert.equal(edit.request.params.annealing_steps, 2);
    for (const field of ['strength_initial', 'strength_final', 'annealing']) assert.ok(edit.request.params[field], field);
    assert.equal(edit.finished_intervals.length, 2);
    let differ = 0;  // not every view sees what was uncovered
    for (const { renders, loss } of edit.finished_intervals) {
      assert.ok(loss > 0);
      for (const { stages } of renders) {
        assert.deepEqual(Object.keys(stages), ['before', 'deformed', 'corrected', 'optimised']);
        const [before, deformed, corrected, optimised] = await Promise.all(Object.values(stages).map(async (link) => (await client.get(link)).body));
        assert.notDeepEqual(deformed, before);
        if (!corrected.equals(deformed) && !optimised.equals(deformed)) ++differ;
      }
    }
    assert.ok(differ >= 2, `${differ} views were corrected`);
    assert.deepEqual((await client.get(edit.links.file)).body, await editedByCommandLine(path.join(demo.folder, 'scene.ply'), demo.folder, request));
  });

  test('can be followed by events, each of them news, to the last', async () => {
    const { id } = await client.submit({ scene: scene.id, ...demo.leaf });
    const events = await client.events(id);
    assert.ok(events.length >= 2, `${events.length} events`);
    assert.ok(events.every(({ event }) => event === 'edit'));
    assert.equal(new Set(events.map((event) => event.id)).size, events.length);
    events.slice(1).forEach(({ edit }, i) => assert.ok(edit.progress >= events[i].edit.progress, 'progress never falls'));
    const last = events.at(-1).edit;
    assert.equal(last.state, 'succeeded');
    assert.deepEqual((await client.edit(id)), last);
    assert.equal((await client.events(id)).length, 1, 'of an ended edit there is one event');
  });

  test('edits the result of another, which stays as it is', async () => {
    const before = await client.file(scene.id, 1);
    const [handle] = demo.ball.handles;
    const back = { ...handle, source: handle.target, target: handle.source };
    const { id } = await client.submit({ scene: scene.id, version: 1, preset: 'preview', handles: [back] });
    const { result_version: version } = await client.succeeded(id);
    const info = (await client.get(`/v1/scenes/${scene.id}`)).json().versions.find((one) => one.version === version);
    assert.equal(info.parent, 1);
    assert.deepEqual(await client.file(scene.id, 1), before);
    const folder = temporaryFolder();
    await writeFile(path.join(folder, 'v1.ply'), before);
    assert.deepEqual(await client.file(scene.id, version), await editedByCommandLine(path.join(folder, 'v1.ply'), demo.folder, { preset: 'preview', handles: [back] }));
  });

  test('of nothing gives the very bytes back', async () => {
    const [{ source, radius }] = demo.ball.handles;
    const { id } = await client.submit({ scene: scene.id, handles: [{ source, target: source, radius }] });
    const { result_version: version } = await client.succeeded(id);
    assert.deepEqual(await client.file(scene.id, version), demo.ply);
  });

  test('sent again under its key is the same edit; the key is good for no other', async () => {
    const request = { scene: scene.id, ...demo.ball, params: { seed: 5 } };
    const key = { 'idempotency-key': 'a key of the client' };
    const once = await client.request('POST', '/v1/edits', { json: request, headers: key, expect: 202 });
    const again = await client.request('POST', '/v1/edits', { json: request, headers: key, expect: 202 });
    assert.equal(again.json().id, once.json().id);
    assert.equal(once.headers['idempotent-replayed'], undefined);
    assert.equal(again.headers['idempotent-replayed'], 'true');
    await client.request('POST', '/v1/edits', { json: { ...request, params: { seed: 6 } }, headers: key, expect: 422 });
    await client.succeeded(once.json().id);
    const later = await client.request('POST', '/v1/edits', { json: request, headers: key, expect: 202 });
    assert.equal(later.json().id, once.json().id, 'also after it has ended');
    await Promise.all(Array.from({ length: 8 }, () => client.submit(request, { 'idempotency-key': 'eight at once' })))
      .then((edits) => assert.equal(new Set(edits.map(({ id }) => id)).size, 1));
  });

  test('waits its turn in the queue, with those of other scenes', async () => {
    const scenes = [scene, await client.upload(demo.ply, { name: 'second' }), await client.upload(demo.ply, { name: 'third' })];
    const edits = [];
    for (let round = 0; round < 2; ++round)
      for (const { id } of scenes) edits.push(await client.submit({ scene: id, ...demo.leaf }));
    const waiting = (await client.get('/v1/edits', { query: { active: 'true' } })).json().edits.filter((edit) => edit.queue_position !== null);
    for (const { id } of scenes) {
      const places = waiting.filter((edit) => edit.scene === id).map((edit) => edit.queue_position);
      assert.deepEqual(places, [...places].sort((a, b) => b - a), 'youngest first; scenes may overtake each other by what they expect');
    }
    const ended = [];
    for (const { id } of edits) ended.push(await client.succeeded(id));
    for (const { id } of scenes) {
      const [earlier, later] = ended.filter((edit) => edit.scene === id);
      assert.ok(later.started >= earlier.ended, 'those of a scene in order');
    }
    ended.sort((a, b) => (a.started < b.started ? -1 : 1));
    ended.slice(1).forEach((edit, i) => assert.ok(edit.started >= ended[i].ended, 'one after the other'));
    assert.deepEqual(ended.filter((edit) => edit.scene === scenes[1].id).map((edit) => edit.result_version), [1, 2]);
    assert.deepEqual(await client.file(scenes[1].id, 1), await client.file(scenes[1].id, 2), 'same request, same bytes');
    assert.deepEqual(await client.file(scenes[1].id, 1), await client.file(scenes[2].id, 1));
    const ofSecond = (await client.get('/v1/edits', { query: { scene: scenes[1].id, limit: 1 } })).json().edits;
    assert.deepEqual(ofSecond.map(({ id }) => id), [edits[4].id]);
    for (const { id } of scenes.slice(1)) await client.delete(`/v1/scenes/${id}`);
  });

  test('leaves its version behind when its record is removed', async () => {
    await client.delete(`/v1/edits/${first.id}`);
    await client.get(`/v1/edits/${first.id}`, { expect: 404 });
    await client.delete(`/v1/edits/${first.id}`, { expect: 404 });
    await client.get(`/v1/scenes/${scene.id}/versions/1/file`);
  });

  test('links to what is known of its version', async () => {
    const { versions } = (await client.get(first.links.scene)).json(), result = await client.get(first.links.result);
    assert.deepEqual(result.json(), versions.find(({ version }) => version === first.result_version));
    assert.equal(result.json().edit, first.id);
    await client.get(first.links.result, { headers: { 'if-none-match': result.headers.etag }, expect: 304 });
  });

  test('leaves the other versions when its own is deleted', async () => {
    const { result_version } = await client.succeeded((await client.submit({ scene: scene.id, ...demo.leaf })).id);
    const url = `/v1/scenes/${scene.id}/versions/${result_version}`, before = await client.file(scene.id, 1);
    await client.delete(url);
    await client.delete(url, { expect: 404 });
    await client.get(url, { expect: 404 });
    await client.get(`${url}/file`, { expect: 404 });
    await client.delete(`/v1/scenes/${scene.id}/versions/0`, { expect: 409 });
    assert.deepEqual(await client.file(scene.id, 1), before);
    const { versions } = (await client.get(`/v1/scenes/${scene.id}`)).json();
    assert.ok(!versions.some(({ version }) => version === result_version));
  });
});

describe('a download', () => {
  const path0 = () => `/v1/scenes/${scene.id}/versions/0/file`;

  test('can be resumed by Range', async () => {
    const whole = await client.get(path0());
    assert.equal(whole.headers['accept-ranges'], 'bytes');
    assert.match(whole.headers['content-disposition'], /^attachment; *filename=.*\.ply"?/);
    const n = whole.body.length;
    const ranges = { 'bytes=0-99': [0, 100], 'bytes=100-': [100, n], 'bytes=-100': [n - 100, n], [`bytes=${n - 1}-${n + 50}`]: [n - 1, n] };
    for (const [range, [begin, end]] of Object.entries(ranges)) {
      const part = await client.get(path0(), { headers: { range }, expect: 206 });
      assert.deepEqual(part.body, whole.body.subarray(begin, end), range);
      assert.equal(part.headers['content-range'], `bytes ${begin}-${end - 1}/${n}`);
      assert.equal(part.headers.etag, whole.headers.etag);
    }
    await client.get(path0(), { headers: { 'if-none-match': whole.headers.etag }, expect: 304 });
  });

  test('comes in the formats of the field', async () => {
    const spz = await client.file(scene.id, 1, 'spz'), splat = await client.file(scene.id, 1, 'splat');
    const info = (await client.get(`/v1/scenes/${scene.id}`)).json().versions[1];
    assert.equal(splat.length, 32 * info.gaussians);
    for (const [bytes, format] of [[spz, 'spz'], [splat, 'splat']]) {
      const again = await client.upload(bytes);
      assert.deepEqual([again.format, again.gaussians], [format, info.gaussians]);
      await client.delete(`/v1/scenes/${again.id}`);
    }
  });
});

describe('a long edit', () => {
  let long, request;
  before(async () => {
    const large = await demoScene({ gaussians: 60_000, views: 24, size: '1024x768', photos: false });
    long = await client.upload(large.ply, { name: 'long' });
    await client.putDataset(long.id, await datasetZip(large.folder));
    request = { scene: long.id, ...large.leaf, params: { intervals: 20, max_image_side: 1024 } };
  });
  const begun = async () => (await client.submit(request)).id;
  const withInterval = (id) => client.until(id, (edit) => edit.finished_intervals.length >= 1);

  test('stopped after an interval keeps it as its result, as if it had been asked for no more', async () => {
    const id = await begun();
    await client.request('POST', `/v1/scenes/${long.id}/versions/0/pick`, { json: { point: [0, 0, 0], radius: 1 }, expect: 200 });
    await withInterval(id);
    const order = (await client.request('POST', `/v1/edits/${id}/stop`, { expect: 200 })).json();
    assert.ok(['stop_requested', 'succeeded'].includes(order.state), order.state);
    const edit = await client.succeeded(id);
    assert.equal(edit.stopped_early, true);
    assert.ok(edit.finished_intervals.length < 20);
    const query = { view: 'view_12.png', format: 'png' };
    assert.notDeepEqual((await client.get(`${edit.links.result}/render`, { query })).body, (await client.get(`/v1/scenes/${long.id}/versions/0/render`, { query })).body);
    await client.request('POST', `/v1/edits/${id}/stop`, { expect: 409 });
    await client.request('POST', `/v1/edits/${id}/cancel`, { expect: 409 });
  });

  test('cancelled leaves nothing behind, and may be cancelled again', async () => {
    const versions = (await client.get(`/v1/scenes/${long.id}`)).json().versions.length;
    const id = await begun();
    await withInterval(id);
    await client.request('POST', `/v1/edits/${id}/cancel`, { json: {}, expect: 200 });
    const edit = await client.ended(id);
    assert.equal(edit.state, 'cancelled');
    assert.equal(edit.result_version, null);
    await client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
    assert.equal((await client.get(`/v1/scenes/${long.id}`)).json().versions.length, versions);
  });

  test('cannot be stopped before it has an interval to keep, but can be cancelled while it waits', async () => {
    const running = await begun(), waiting = await begun();
    await client.request('POST', `/v1/edits/${waiting}/stop`, { expect: 409 });
    assert.equal((await client.request('POST', `/v1/edits/${waiting}/cancel`, { expect: 200 })).json().state, 'cancelled');
    await client.request('POST', `/v1/edits/${running}/cancel`, { expect: 200 });
    await client.ended(running);
  });

  test('keeps its scene and its own record from being removed, and lets pictures through', async () => {
    const id = await begun();
    await client.request('DELETE', `/v1/scenes/${long.id}`, { expect: 409 });
    await client.request('DELETE', `/v1/edits/${id}`, { expect: 409 });
    for (let k = 0; k < 5; ++k)
      await client.get(`/v1/scenes/${long.id}/versions/0/render`, { query: { eye: `${k},-2,-4`, target: '0,0,0', width: 320, height: 240 } });
    assert.ok(!finalStates.includes((await client.edit(id)).state), 'the pictures came while the edit ran');
    await client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
    await client.ended(id);
    await client.delete(`/v1/edits/${id}`);
  });

  test('polled with its ETag answers 304 while nothing is new', async () => {
    const id = await begun();
    await client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
    await client.ended(id);
    const { headers } = await client.get(`/v1/edits/${id}`);
    await client.get(`/v1/edits/${id}`, { headers: { 'if-none-match': headers.etag }, expect: 304 });
    const list = await client.get('/v1/edits', { query: { scene: long.id } });
    await client.get('/v1/edits', { query: { scene: long.id }, headers: { 'if-none-match': list.headers.etag }, expect: 304 });
  });
});

describe('the service', () => {
  test('has its data after a restart', async () => {
    const before = { scenes: (await client.get('/v1/scenes')).json().scenes, edits: (await client.get('/v1/edits')).json().edits };
    const [file, views] = [await client.file(scene.id, 1), (await client.get(`/v1/scenes/${scene.id}/views`)).json()];
    await service.stop();
    await service.start();
    client = service.client;
    const still = ({ memory_bytes: _, ...rest }) => rest;
    assert.deepEqual((await client.get('/v1/scenes')).json().scenes.map(still), before.scenes.map(still));
    assert.deepEqual((await client.get('/v1/edits')).json().edits, before.edits);
    assert.deepEqual(await client.file(scene.id, 1), file);
    assert.deepEqual((await client.get(`/v1/scenes/${scene.id}/views`)).json(), views);
    const { result_version: version } = await client.succeeded((await client.submit({ scene: scene.id, version: 1, ...demo.leaf })).id);
    const known = before.scenes.find(({ id }) => id === scene.id).versions;
    assert.ok(version > known.at(-1).version, 'numbers go on');
  });

  test('says what it can do, and how it is', async () => {
    const info = await client.get('/v1/info');
    await client.get('/v1/info', { headers: { 'if-none-match': info.headers.etag }, expect: 304 });
    assert.equal(info.json().scene_root, true);
    assert.equal(info.json().token_required, false);
    const metrics = (await client.get('/metrics')).body.toString();
    assert.match(metrics, /^# TYPE \w+ (counter|gauge|histogram)/m);
    await client.request('POST', '/v1/session', { expect: 204 });
    await client.request('DELETE', '/v1/session', { expect: 204 });
    for (const where of ['/', '/openapi.yaml']) {
      const page = await client.get(where);
      await client.get(where, { headers: { 'if-none-match': page.headers.etag }, expect: 304 });
    }
    assert.match((await client.get('/')).headers['content-security-policy'], /default-src/);
    await service.alive();
  });

  test('says 304 to whoever has its lists already', async () => {
    for (const where of ['/v1/scenes', `/v1/scenes/${scene.id}`, `/v1/scenes/${scene.id}/views`]) {
      const { headers } = await client.get(where);
      await client.get(where, { headers: { 'if-none-match': headers.etag }, expect: 304 });
    }
  });
});

describe('a real capture', () => {
  const real = fox();

  test('agrees with its photos, is edited, and is what the command line makes of it', { skip: real.absent }, async () => {
    const capture = await client.upload(real.ply, { name: 'fox' });
    assert.equal(capture.gaussians, 62_298);
    const withDataset = await client.putDataset(capture.id, await datasetZip(real.folder));
    assert.equal(withDataset.dataset.views, 50);
    assert.ok(Math.abs(withDataset.dataset.psnr_mean_db - 35.2) < 1, `PSNR ${withDataset.dataset.psnr_mean_db}`);  // 35.2 is of all photos
    assert.equal(withDataset.dataset.psnr_worst_view, '0115.jpg');
    const request = { scene: capture.id, ...real.drags.ear_up, preset: 'preview' };
    const preview = (await client.post('/v1/previews', request)).json();
    const { id } = await client.submit(request);
    const [events, edit] = await Promise.all([client.events(id), client.succeeded(id)]);
    assert.equal(events.at(-1).edit.state, 'succeeded');
    assert.deepEqual(edit.handles, preview.handles.map(({ gaussians }) => ({ gaussians })));
    assert.deepEqual((await client.get(edit.links.file)).body, await editedByCommandLine(path.join(real.folder, 'point_cloud.ply'), real.folder, request));
    assert.deepEqual(await client.file(capture.id, 0), real.ply);
  });
});

test('an edit that failed is taken up again', async () => {
  const mortal = await Service.start({ args: ['--edit-attempts', '1', '--threads', '1'] });
  const { id: of } = await mortal.client.upload(demo.ply);
  const { id } = await mortal.client.submit({ scene: of, ...demo.leaf, params: { intervals: 12, views: 4, max_image_side: 160 } });
  await mortal.client.post(`/v1/edits/${id}/requeue`, undefined, { expect: 409 });
  await mortal.client.until(id, ({ finished_intervals: done }) => done.length >= 1);
  await mortal.kill();
  await mortal.start();
  assert.equal((await mortal.client.ended(id)).state, 'failed');
  const again = (await mortal.client.post(`/v1/edits/${id}/requeue`)).json();
  assert.deepEqual([again.error, again.ended], [null, null]);
  assert.equal((await mortal.client.succeeded(id)).finished_intervals.length, 12);
  await mortal.stop();
});

test('every success that the contract lists has been seen', () => {
  const missing = [];
  for (const { id, operation } of operations)
    for (const status of Object.keys(operation.responses).filter((code) => code < '400'))
      if (timesSeen(id, Number(status)) === 0) missing.push(`${id} ${status}`);
  assert.deepEqual(missing, []);
});
