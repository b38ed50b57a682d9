// Several fronts and workers over one database and one data folder, as on several hosts that share a disk: any of them
// may die or be halted at any moment.
import assert from 'node:assert/strict';
import { readdirSync } from 'node:fs';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { finalStates } from './support/client.mjs';
import { Postgres, installed } from './support/postgres.mjs';
import { Service, temporaryFolder } from './support/program.mjs';
import { demoScene } from './support/scenes.mjs';

assert.ok(installed || !process.env.CI, 'PostgreSQL\'s server is absent in CI');

const seed = Number(process.env.SPLATDRAG_TEST_SEED ?? 1);
/// Numbers in [0, 1), the same for the same seed (mulberry32).
const random = ((state) => () => {
  state = (state + 0x6d2b79f5) | 0;
  let t = Math.imul(state ^ (state >>> 15), state | 1);
  t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
  return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
})(seed);
const one = (list) => list[Math.floor(random() * list.length)];

const leaseSeconds = 3;

describe('fronts and workers', { skip: !installed && 'PostgreSQL\'s server is not on this machine (postgresql-15)' }, () => {
  const dataDir = temporaryFolder();
  let postgres, demo, fronts, workers, longTruth, shortTruths;
  const start = (role) => Service.start({ dataDir, args: ['--store', postgres.address, '--role', role, '--lease-seconds', leaseSeconds, '--edit-attempts', 1000, '--threads', 1] });
  const shortEdit = (scene, drag, intervals) => ({ scene, ...demo[drag], params: { intervals, views: 3, max_image_side: 96 } });
  const shortOnes = [['ball', 2], ['leaf', 3], ['ball', 5]];
  const longEdit = (scene, intervals = 8) => ({ scene, ...demo.leaf, params: { intervals, max_image_side: 400 } });
  /// What a service alone makes of requests about the one scene.
  const undisturbed = async (...requests) => {
    const alone = await Service.start();
    const scene = await alone.client.upload(demo.ply, { name: 'alone' });
    const files = [];
    for (const request of requests) {
      const { id } = await alone.client.submit({ ...request, scene: scene.id });
      files.push(await alone.client.file(scene.id, (await alone.client.succeeded(id)).result_version));
    }
    await alone.stop();
    return files;
  };
  /// Asks any front, until one answers.
  const insist = async (ask) => {
    for (const deadline = Date.now() + 60_000; ;) {
      try {
        const answer = await ask(one(fronts).client);
        if (![429, 503].includes(answer.status)) return answer;
      } catch (error) {
        if (error instanceof assert.AssertionError) throw error;  // no front was killed in the middle of that
      }
      assert.ok(Date.now() < deadline, 'no front answers');
      await sleep(50);
    }
  };
  const submit = async (json, key) => (await insist((client) => client.request('POST', '/v1/edits', { json, headers: { 'idempotency-key': key }, expect: [202, 429, 503] }))).json().id;
  const edit = async (id) => (await insist((client) => client.request('GET', `/v1/edits/${id}`, { expect: [200, 503] }))).json();
  const succeeded = async (id) => {
    for (const deadline = Date.now() + 120_000; ;) {
      const now = await edit(id);
      if (finalStates.includes(now.state)) {
        assert.equal(now.state, 'succeeded', JSON.stringify(now.error));
        return now;
      }
      assert.ok(Date.now() < deadline, `${id} does not end: ${JSON.stringify(now, null, 1)}`);
      await sleep(50);
    }
  };
  const file = async (scene, version) => (await insist((client) => client.request('GET', `/v1/scenes/${scene}/versions/${version}/file`, { query: { format: 'ply' }, expect: [200, 503] }))).body;
  const until = (id, reached) => fronts[0].client.until(id, reached, { every: 5 });

  before(async () => {
    demo = await demoScene({ gaussians: 8000, views: 4, size: '320x240', photos: false });
    [longTruth, ...shortTruths] = await undisturbed(longEdit(), ...shortOnes.map((kind) => shortEdit(undefined, ...kind)));
    postgres = await Postgres.start();
    // At once: one of them is the first, and the others wait until it has put things in order.
    const [a, b, worker] = await Promise.all(['front', 'front', 'worker'].map(start));
    fronts = [a, b];
    workers = [worker];
  });
  after(async () => {
    console.log(`seed ${seed}`);
    for (const service of [...fronts ?? [], ...workers ?? []]) await service.stop();
    await postgres?.crash();
  });

  test('any front answers for what has been done at another', async () => {
    const [a, b] = fronts.map(({ client }) => client);
    const scene = await a.upload(demo.ply, { name: 'chair' });
    const about = async (client) => ({ ...(await client.get(`/v1/scenes/${scene.id}`)).json(), memory_bytes: 0 });
    assert.deepEqual(await about(b), await about(a));
    await b.request('PATCH', `/v1/scenes/${scene.id}`, { json: { name: 'seat' }, expect: 200 });
    assert.equal((await about(a)).name, 'seat');
    assert.notEqual((await b.upload(demo.ply, { name: 'other' })).id, scene.id);
    assert.equal((await a.get('/v1/scenes')).json().scenes.length, 2);

    const { id } = await a.submit(longEdit(scene.id));
    const told = await b.events(id);
    assert.ok(told.length >= 3, `progress is heard of elsewhere: ${told.length} events`);
    const { state, result_version: version } = told.at(-1).edit;
    assert.equal(state, 'succeeded');
    for (const [address, query] of [
      [`/v1/edits/${id}`, {}],
      [`/v1/scenes/${scene.id}/versions/${version}/file`, { format: 'ply' }],
      [`/v1/scenes/${scene.id}/versions/${version}/render`, { eye: '0,-1,-4', target: '0,0,0', width: 64, height: 48 }],
      [`/v1/edits/${id}/intervals/1/renders/0`, { stage: 'deformed' }],
    ]) {
      const [here, there] = [await a.get(address, { query }), await b.get(address, { query })];
      assert.deepEqual(there.body, here.body, address);
      assert.equal(there.headers.etag, here.headers.etag, address);
    }
    assert.deepEqual(await file(scene.id, version), longTruth);
    await b.delete(`/v1/scenes/${scene.id}/versions/${version}`);
    await a.request('GET', `/v1/scenes/${scene.id}/versions/${version}/file`, { expect: 404 });
    await a.delete(`/v1/scenes/${scene.id}`);
    await b.request('GET', `/v1/scenes/${scene.id}`, { expect: 404 });
  });

  test('a worker answers for its health alone, and a front takes part in no edit', async () => {
    const ask = (service, address) => fetch(new URL(address, service.url));
    for (const address of ['/healthz', '/readyz', '/metrics']) assert.equal((await ask(workers[0], address)).status, 200);
    for (const address of ['/', '/v1/scenes', '/v1/info']) {
      const refused = await ask(workers[0], address);
      assert.equal(refused.status, 404);
      assert.match((await refused.json()).detail, /this process is a worker .*ask a front/);
    }
    await fronts[0].alive();
  });

  test('what is asked at one front reaches the worker, and a worker that is told to end hands its edit on', async () => {
    const [a, b] = fronts.map(({ client }) => client);
    const scene = await a.upload(demo.ply, { name: 'asked' });
    const half = (edit) => edit.finished_intervals.length >= 2;
    const stopped = await a.submit(longEdit(scene.id, 20));
    await b.until(stopped.id, half);
    await b.request('POST', `/v1/edits/${stopped.id}/stop`, { expect: 200 });
    assert.equal((await a.succeeded(stopped.id)).stopped_early, true);
    const cancelled = await a.submit(longEdit(scene.id, 20));
    await b.until(cancelled.id, half);
    await b.request('POST', `/v1/edits/${cancelled.id}/cancel`, { expect: 200 });
    assert.equal((await a.ended(cancelled.id)).state, 'cancelled');

    const { id } = await a.submit(longEdit(scene.id));
    await b.until(id, half);
    await workers[0].stop();
    const left = await a.edit(id);
    assert.equal(left.state, 'running');
    workers[0] = await start('worker');
    const end = await a.succeeded(id);
    assert.ok(left.finished_intervals.length >= 2);
    assert.deepEqual(await file(scene.id, end.result_version), longTruth);
  });

  test('a worker that is halted beyond its lease writes nothing when it goes on', async () => {
    const scene = await fronts[0].client.upload(demo.ply, { name: 'halted' });
    const { id } = await fronts[0].client.submit(longEdit(scene.id));
    await until(id, (edit) => edit.finished_intervals.length >= 1);
    workers[0].process.kill('SIGSTOP');
    workers.push(await start('worker'));
    const end = await succeeded(id);
    const seen = async () => [
      await edit(id), (await fronts[1].client.get(`/v1/scenes/${scene.id}`)).json().versions, readdirSync(path.join(dataDir, 'scenes/.made')),
      readdirSync(path.join(dataDir, 'scenes', scene.id, 'versions')), await file(scene.id, end.result_version)];
    const before = await seen();
    assert.equal(before[1].length, 2);
    workers[0].process.kill('SIGCONT');
    await sleep(1500);
    assert.deepEqual(await seen(), before);
    assert.deepEqual(before.at(-1), longTruth);
    await workers[1].kill();  // and it works on
    await succeeded((await fronts[0].client.submit(shortEdit(scene.id, 'ball', 2))).id);
    await workers[1].start();
  });

  test('killed at random, and their database restarted, they carry out every accepted edit once', async () => {
    const scenes = [];
    for (let i = 0; i < 3; ++i) scenes.push((await one(fronts).client.upload(demo.ply, { name: `storm ${i}` })).id);
    const edits = [...Array(30).keys()].map((i) => ({ scene: scenes[i % 3], key: `storm ${i}`, kind: i % 7 % 3 }));
    const storm = { kills: 0, over: false };
    const rage = async () => {
      while (!storm.over && storm.kills < 12) {
        await sleep(100 + random() * 400);
        if (storm.kills === 6) {
          await postgres.crash();
          await sleep(300);
          await postgres.start();
        }
        const victim = one(random() < 0.6 ? workers : fronts);
        await victim.kill();
        ++storm.kills;
        await victim.start();
      }
    };
    const raging = rage();
    await Promise.all(edits.map(async (wanted, i) => {
      await sleep(i * 150);
      wanted.id = await submit(shortEdit(wanted.scene, ...shortOnes[wanted.kind]), wanted.key);
    }));
    await raging;
    storm.over = true;
    for (const wanted of edits) {
      const end = await succeeded(wanted.id);
      assert.deepEqual(await file(wanted.scene, end.result_version), shortTruths[wanted.kind], `${wanted.id}, kind ${wanted.kind}`);
      assert.equal(await submit(shortEdit(wanted.scene, ...shortOnes[wanted.kind]), wanted.key), wanted.id, 'its key finds it');
    }
    assert.equal(new Set(edits.map(({ id }) => id)).size, edits.length);
    for (const scene of scenes) {
      const { versions } = (await fronts[0].client.get(`/v1/scenes/${scene}`)).json();
      const made = edits.filter((wanted) => wanted.scene === scene).map(({ id }) => id);
      assert.deepEqual(versions.slice(1).map(({ edit }) => edit).sort(), made.sort(), 'each once');
    }
    assert.equal((await fronts[0].client.get('/v1/edits', { query: { active: true } })).json().edits.length, 0);
    // What a worker has made whose claim was over goes with the next version that anybody makes.
    await succeeded(await submit(shortEdit(scenes[0], 'ball', 2), 'after the storm'));
    assert.deepEqual(readdirSync(path.join(dataDir, 'scenes/.made')).filter((name) => name.startsWith('e')), []);
    for (const service of [...fronts, ...workers]) assert.equal((await fetch(new URL('/readyz', service.url))).status, 200);
    assert.ok(storm.kills >= 10, `${storm.kills} kills`);
  });
});
