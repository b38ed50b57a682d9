// kill -9 at any moment: what was accepted is still there after the restart, goes on, and ends with the bytes of an
// undisturbed run.
import assert from 'node:assert/strict';
import { readdir } from 'node:fs/promises';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { finalStates } from './support/client.mjs';
import { summary } from './support/contract.mjs';
import { Service } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const seed = Number(process.env.SPLATDRAG_TEST_SEED ?? 1);
/// Numbers in [0, 1), the same for the same seed (mulberry32).
const random = ((state) => () => {
  state = (state + 0x6d2b79f5) | 0;
  let t = Math.imul(state ^ (state >>> 15), state | 1);
  t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
  return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
})(seed);

let service, scene, request, truth, seconds;
before(async () => {
  const demo = await demoScene({ gaussians: 20_000, views: 12, size: '640x480', photos: false });
  // More kills than a service meets by itself: an edit must not be given up for them.
  service = await Service.start({ args: ['--edit-attempts', 1000] });
  scene = await service.client.upload(demo.ply, { name: 'killed' });
  await service.client.putDataset(scene.id, await datasetZip(demo.folder));
  request = { scene: scene.id, ...demo.leaf, params: { intervals: 12, max_image_side: 640 } };
  const start = Date.now();
  const edit = await service.client.succeeded((await service.client.submit(request)).id);
  seconds = (Date.now() - start) / 1000;
  truth = await service.client.file(scene.id, edit.result_version);
});
after(async () => {
  console.log(`seed ${seed}; an undisturbed run takes ${seconds} s; ${summary()}`);
  await service?.stop();
});

const again = async () => {
  await service.kill();
  await service.start();
};
const result = async (id) => service.client.file(scene.id, (await service.client.succeeded(id)).result_version);
const versions = async () => (await service.client.get(`/v1/scenes/${scene.id}`)).json().versions.length;

test('killed at twenty moments, an edit goes on each time and ends with the same bytes', async () => {
  let kills = 0, id, intervals = 0, resumed = 0;
  while (kills < 20) {
    if (!id) {
      id = (await service.client.submit(request)).id;
      intervals = 0;
    }
    await sleep(random() * seconds * 1000 * 0.35);
    await again();
    ++kills;
    const edit = await service.client.edit(id);  // still there
    assert.ok(edit.finished_intervals.length >= intervals, `kill ${kills}: ${edit.finished_intervals.length} intervals after ${intervals}`);
    if (edit.finished_intervals.length > 0 && !finalStates.includes(edit.state)) ++resumed;
    intervals = edit.finished_intervals.length;
    if (finalStates.includes(edit.state)) {
      assert.deepEqual(await result(id), truth, `kill ${kills}`);
      id = undefined;
    }
  }
  if (id) assert.deepEqual(await result(id), truth);
  assert.ok(resumed >= 3, `only ${resumed} of ${kills} kills hit an edit with a finished interval`);
});

test('killed in the middle of correcting and optimising, with other numbers of threads, an edit ends with the same bytes', async () => {
  const params = { intervals: 3, iterations: 700, annealing_steps: 2, views: 8, max_image_side: 320, corrector: 'scene' };
  const corrected = { ...request, params };
  const undisturbed = await service.client.succeeded((await service.client.submit(corrected)).id);
  assert.equal(undisturbed.request.params.corrector, 'scene');
  for (const { loss, renders } of undisturbed.finished_intervals) {
    assert.ok(loss > 0);
    assert.ok(renders[0].stages.corrected);
  }
  const pictures = async (edit) => Promise.all(edit.finished_intervals.flatMap(({ renders }) => renders).flatMap(({ stages }) =>
    ['corrected', 'optimised'].map(async (stage) => (await service.client.get(stages[stage])).body.toString('base64'))));
  const expected = await service.client.file(scene.id, undisturbed.result_version);
  assert.notDeepEqual(expected, truth, 'it makes a difference');

  const { id } = await service.client.submit(corrected);
  const args = service.args;
  try {
    for (const [interval, stage, threads] of [[1, 'optimise', 1], [1, 'correct', 3], [2, 'optimise', 4], [2, 'correct', 2], [3, 'optimise', 4], [3, 'optimise', 1]]) {
      const from = stage === 'optimise' ? 1 + Math.floor(random() * 700) : 0;  // of 1400: news come ten times a second
      const hit = await service.client.until(id, (edit) => edit.interval === interval && edit.stage === stage && edit.iteration >= from, { every: 5 });
      assert.equal(hit.iterations, 1400);
      // None has run while the views of a correction are set up.
      if (stage === 'optimise') assert.ok(hit.loss > 0 || hit.iteration === 700, `the loss of iteration ${hit.iteration} is told: ${hit.loss}`);
      service.args = [...args, '--threads', threads];
      await again();
      const edit = await service.client.edit(id);
      assert.equal(edit.finished_intervals.length, interval - 1, 'it goes on with the interval that was cut');
    }
  } finally {
    service.args = args;
  }
  const edit = await service.client.succeeded(id);
  assert.equal(edit.loss, null);
  assert.deepEqual(edit.finished_intervals.map(({ loss }) => loss), undisturbed.finished_intervals.map(({ loss }) => loss));
  assert.deepEqual(await service.client.file(scene.id, edit.result_version), expected);
  assert.deepEqual(await pictures(edit), await pictures(undisturbed));
  await again();  // with the usual threads
});

test('killed right after 202, an edit is carried out, and the key still finds it', async () => {
  const key = { 'idempotency-key': 'sent before the power cut' };
  const { id } = await service.client.submit(request, key);
  await again();
  assert.equal((await service.client.submit(request, key)).id, id);
  assert.deepEqual(await result(id), truth);
});

test('killed with a queue, all of it is carried out in order', async () => {
  const ids = [];
  for (let i = 0; i < 3; ++i) ids.push((await service.client.submit(request)).id);
  await again();
  const edits = [];
  for (const id of ids) edits.push(await service.client.succeeded(id));
  edits.slice(1).forEach((edit, i) => assert.ok(edit.result_version > edits[i].result_version));
  assert.deepEqual(await service.client.file(scene.id, edits[2].result_version), truth);
});

test('killed during a stop, the interval is kept', async () => {
  const { id } = await service.client.submit(request);
  await service.client.until(id, (edit) => edit.finished_intervals.length >= 2);
  const before = await versions();
  await service.client.request('POST', `/v1/edits/${id}/stop`, { expect: 200 });
  await again();
  const edit = await service.client.succeeded(id);
  assert.equal(edit.stopped_early, true);
  assert.equal(await versions(), before + 1);
  await service.client.file(scene.id, edit.result_version);
});

test('killed during a cancel, nothing is kept', async () => {
  const before = await versions();
  const { id } = await service.client.submit(request);
  await service.client.until(id, (edit) => edit.finished_intervals.length >= 1);
  await service.client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
  await again();
  assert.equal((await service.client.ended(id)).state, 'cancelled');
  assert.equal(await versions(), before);
});

test('killed while the last interval becomes a version, there is one version, not two', async () => {
  for (const wait of [0, 5, 20]) {
    const before = await versions();
    const { id } = await service.client.submit(request);
    await service.client.until(id, (edit) => edit.finished_intervals.length >= 11, { every: 2 });
    await sleep(wait);
    await again();
    assert.deepEqual(await result(id), truth);
    assert.equal(await versions(), before + 1);
  }
});

test('killed during uploads and removals, a scene is whole or not there', async () => {
  const { ply } = await demoScene({ gaussians: 20_000, views: 4, photos: false });
  for (let i = 0; i < 6; ++i) {
    const known = new Set((await service.client.get('/v1/scenes')).json().scenes.map(({ id }) => id));
    const extra = await service.client.upload(ply, { name: 'extra' });
    const pending = [service.client.upload(ply, { name: 'half' }), service.client.request('DELETE', `/v1/scenes/${extra.id}`)].map((one) => one.catch(() => null));
    await sleep(random() * 30);
    await again();
    await Promise.all(pending);
    for (const found of (await service.client.get('/v1/scenes')).json().scenes) {
      if (known.has(found.id)) continue;
      assert.deepEqual(await service.client.file(found.id, 0), ply, `${found.id} is whole`);
      await service.client.delete(`/v1/scenes/${found.id}`);
    }
  }
  assert.deepEqual((await service.client.get('/v1/scenes')).json().scenes.map(({ id }) => id), [scene.id]);
  assert.deepEqual((await readdir(path.join(service.dataDir, 'scenes'))).filter((name) => /^s\d/.test(name)), [scene.id], 'no leavings on disk');
});
