// kill -9 at any moment of the whole life of scenes, versions and edits: what was answered holds after the restart, what
// was not answered has happened or has not, and every version has the bytes of an undisturbed run.
//
//     SPLATDRAG_TEST_KILLS=200 node --test lifecycle.test.mjs
//
// kills more often than CI has time for; SPLATDRAG_TEST_SEED makes other ones.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readdirSync } from 'node:fs';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { finalStates } from './support/client.mjs';
import { summary } from './support/contract.mjs';
import { Service, program } from './support/program.mjs';
import { randomFrom } from './support/random.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const seed = Number(process.env.SPLATDRAG_TEST_SEED ?? 1);
const kills = Number(process.env.SPLATDRAG_TEST_KILLS ?? 12);
const random = randomFrom(seed);

const mostScenes = 3, mostWaiting = 5;
let service, demo, zip;
const requests = {};  // by kind: without a scene
const truth = {};     // by kind: the bytes of its version
/// What the service has promised: by id.
const scenes = new Map(), edits = new Map();
const counts = {};
let keys = 0;

before(async () => {
  demo = await demoScene({ gaussians: 4_000, views: 6, size: '320x240', photos: false });
  zip = await datasetZip(demo.folder);
  requests.short = { ...demo.leaf, params: { intervals: 1, views: 3, max_image_side: 64 } };
  requests.long = { ...demo.ball, params: { intervals: 12, max_image_side: 320 } };
  requests.corrected = { ...demo.leaf, preset: 'draft', params: { intervals: 2, iterations: 12, views: 4, max_image_side: 128 } };
  service = await Service.start({ args: ['--edit-attempts', 1_000_000] });
  const scene = await newScene();
  for (const [kind, request] of Object.entries(requests)) {
    const edit = await service.client.succeeded((await service.client.submit({ scene: scene.id, ...request })).id);
    truth[kind] = await service.client.file(scene.id, edit.result_version);
    await service.client.delete(`/v1/edits/${edit.id}`);
  }
  await service.client.delete(`/v1/scenes/${scene.id}`);
});
after(async () => {
  console.log(`seed ${seed}, ${kills} kills: ${JSON.stringify(counts)}; ${summary()}`);
  await service?.stop();
});

/// A scene with its dataset: edits of one without would choose other views.
const newScene = async () => {
  const scene = await service.client.upload(demo.ply, { name: 'lives' });
  await service.client.putDataset(scene.id, zip);
  return scene;
};

const count = (what) => { counts[what] = (counts[what] ?? 0) + 1; };
const waiting = () => [...edits.values()].filter((edit) => !edit.ended);

/// One thing that a client does. What it has begun is noted before; what was answered, after.
const operations = {
  async upload() {
    if (scenes.size >= mostScenes) return;
    const scene = await service.client.upload(demo.ply, { name: 'lives' });
    scenes.set(scene.id, { ready: false, deleting: false, versions: new Set() });
    await service.client.putDataset(scene.id, zip);
    scenes.get(scene.id).ready = true;
  },
  async submit() {
    const ready = [...scenes].filter(([, scene]) => scene.ready && !scene.deleting).map(([id]) => id);
    if (ready.length === 0 || waiting().length >= mostWaiting) return;
    const kind = random.of(Object.keys(requests)), key = `lives ${++keys}`, scene = random.of(ready);
    const request = { scene, ...requests[kind] };
    const answer = await service.client.request('POST', '/v1/edits', { json: request, headers: { 'idempotency-key': key }, expect: [202, 404] });
    if (answer.status === 404) return assert.ok(scenes.get(scene)?.deleting ?? true, `${scene} is there`);
    const { id } = answer.json();
    edits.set(id, { kind, key, scene, request, asked: new Set(), ended: null, deleting: false });
  },
  async cancel() {
    const edit = random.of([...edits].filter(([, known]) => !known.ended));
    if (!edit || random() < 0.7) return;
    edit[1].asked.add('cancel');
    await service.client.request('POST', `/v1/edits/${edit[0]}/cancel`, { expect: [200, 404, 409] });
  },
  async stop() {
    const edit = random.of([...edits].filter(([, known]) => !known.ended && known.kind === 'long'));
    if (!edit || random() < 0.7) return;
    edit[1].asked.add('stop');
    await service.client.request('POST', `/v1/edits/${edit[0]}/stop`, { expect: [200, 404, 409] });
  },
  async forget() {
    const edit = random.of([...edits].filter(([, known]) => known.ended && !known.deleting));
    if (!edit) return;
    edit[1].deleting = true;
    await service.client.request('DELETE', `/v1/edits/${edit[0]}`, { expect: 204 });
    edit[1].gone = true;
  },
  async deleteVersion() {
    const scene = random.of([...scenes].filter(([, known]) => !known.deleting && known.versions.size > 0));
    if (!scene) return;
    const [id, known] = scene, version = random.of([...known.versions]);
    known.versions.delete(version);
    const { status } = await service.client.request('DELETE', `/v1/scenes/${id}/versions/${version}`, { expect: [204, 404, 409] });
    if (status !== 409) (known.gone ??= new Set()).add(version);
    else known.versions.add(version);
  },
  async deleteScene() {
    const scene = random.of([...scenes].filter(([, known]) => known.ready && !known.deleting));
    if (!scene || random() < 0.6) return;
    const [id, known] = scene;
    known.deleting = true;
    const { status } = await service.client.request('DELETE', `/v1/scenes/${id}`, { expect: [204, 409] });
    if (status === 204) known.gone_whole = true;
    else known.deleting = false;
  },
  async look() {
    const scene = random.of([...scenes].filter(([, known]) => !known.deleting));
    if (!scene) return;
    const version = random.of([0, ...scene[1].versions]);
    await service.client.request('GET', `/v1/scenes/${scene[0]}/versions/${version}/file`, { expect: [200, 404] });
  },
};

/// Does things until the service is gone.
const live = async (isOver) => {
  while (!isOver()) {
    const what = random.of(Object.keys(operations));
    try {
      await operations[what]();
      count(what);
    } catch (error) {
      if (error instanceof assert.AssertionError) throw error;
      if (!isOver()) throw error;
      count('cut short');
    }
    await sleep(random() * 20);
  }
};

/// An edit as it is now, held against what was promised of it.
const checkEdit = async (id) => {
  const known = edits.get(id);
  const answer = await service.client.request('GET', `/v1/edits/${id}`, { expect: known.deleting ? [200, 404] : 200 });
  if (known.gone) assert.equal(answer.status, 404, `${id} was removed`);
  if (answer.status === 404) return void edits.delete(id);
  const edit = answer.json();
  assert.equal(edit.scene, known.scene);
  if (known.ended) {
    assert.equal(edit.state, known.ended.state, `${id} had ended`);
    assert.equal(edit.result_version, known.ended.result_version);
    return;
  }
  const again = await service.client.submit(known.request, { 'idempotency-key': known.key });
  assert.equal(again.id, id, 'its key finds it');
  if (!finalStates.includes(edit.state)) return;
  known.ended = edit;
  count(edit.state);
  assert.ok(edit.state === 'succeeded' || known.asked.has('cancel'), `${id} ${edit.state}: ${JSON.stringify(edit.error)}`);
  assert.ok(!edit.stopped_early || known.asked.has('stop'), `${id} ended early`);
  const scene = scenes.get(known.scene);
  if (edit.state !== 'succeeded' || !scene || scene.deleting) return;
  const bytes = await service.client.file(known.scene, edit.result_version);
  if (!edit.stopped_early) assert.deepEqual(bytes, truth[known.kind], `the bytes of ${id}, ${known.kind}`);
  scene.versions.add(edit.result_version);
};

const checkScene = async (id) => {
  const known = scenes.get(id);
  const answer = await service.client.request('GET', `/v1/scenes/${id}`, { expect: known.deleting ? [200, 404] : 200 });
  if (known.gone_whole) assert.equal(answer.status, 404, `${id} was deleted`);
  if (answer.status === 404) {
    scenes.delete(id);
    for (const [edit, { scene }] of edits) if (scene === id) assert.ok(edits.get(edit).ended, `${edit} needed ${id}`);
    return;
  }
  known.deleting = false;
  const scene = answer.json();
  assert.deepEqual(await service.client.file(id, 0), demo.ply, `${id} is whole`);
  if (known.ready) assert.equal(scene.dataset.views, 6);
  const there = scene.versions.map(({ version }) => version);
  for (const version of known.versions) {
    assert.ok(there.includes(version), `version ${version} of ${id}`);
    await service.client.file(id, version);
  }
  for (const version of known.gone ?? []) assert.ok(!there.includes(version), `version ${version} of ${id} was deleted`);
};

test(`${kills} times killed, it loses nothing`, { timeout: 30 * 60_000 }, async () => {
  for (let kill = 0; kill < kills; ++kill) {
    let over = false;
    const hands = [live(() => over), live(() => over)];
    await sleep(20 + random() * 600);
    over = true;
    await service.kill();
    await Promise.all(hands);
    await service.start();
    count('kills');
    for (const id of [...edits.keys()]) await checkEdit(id);
    for (const id of [...scenes.keys()]) await checkScene(id);
    // A scene whose upload was not answered is there or not; nobody knows of it.
    for (const { id } of (await service.client.get('/v1/scenes')).json().scenes)
      if (!scenes.has(id)) {
        assert.deepEqual(await service.client.file(id, 0), demo.ply, `${id} is whole`);
        count('unanswered scenes');
        const { status } = await service.client.request('DELETE', `/v1/scenes/${id}`, { expect: [204, 409] });
        if (status === 409) scenes.set(id, { ready: false, deleting: false, versions: new Set() });
      }
    assert.ok(!/"level":"error"/.test(service.log), service.log.slice(-2000));
  }
  for (const id of [...edits.keys()]) {
    if (!edits.get(id).ended) await service.client.ended(id, { timeout: 300_000 });
    await checkEdit(id);
  }
  for (const id of [...scenes.keys()]) await checkScene(id);
  await service.stop();
  const checked = execFileSync(program, ['admin', 'check', '--data', service.dataDir], { encoding: 'utf8' });
  assert.match(checked, /nothing|0 damaged|no damage|sound/i, checked);
  const folders = readdirSync(path.join(service.dataDir, 'scenes')).filter((name) => /^s\d/.test(name));
  assert.ok(folders.every((name) => scenes.has(name)), `leavings on disk: ${folders}`);
  await service.start();
  for (const id of [...scenes.keys()]) await checkScene(id);
});
