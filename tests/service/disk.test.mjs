// A full disk fails what needs it, in plain words, and harms nothing else.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { rm, statfs, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { finalStates } from './support/client.mjs';
import { summary } from './support/contract.mjs';
import { Service, atEnd, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const disk = temporaryFolder();
const mounted = (() => {
  try {
    execFileSync('mount', ['-t', 'tmpfs', '-o', 'size=24m', 'tmpfs', disk], { stdio: 'pipe' });
    return true;
  } catch {
    return false;
  }
})();
if (mounted) atEnd(() => execFileSync('umount', ['--lazy', disk]));

describe('a disk that is full', { skip: mounted ? false : 'a small file system cannot be mounted here: that takes root' }, () => {
  let demo, service, client, scene;
  before(async () => {
    demo = await demoScene({ gaussians: 20_000, views: 12, size: '640x480', photos: false });
    service = await Service.start({ dataDir: path.join(disk, 'data') });
    client = service.client;
    scene = await client.upload(demo.ply, { name: 'demo' });
    await client.putDataset(scene.id, await datasetZip(demo.folder));
  });
  after(async () => {
    console.log(`${summary()}`);
    await service?.stop();
  });

  const filler = path.join(disk, 'filler');
  /// Fills the disk up to the last `leave` bytes. A service at work may take some of them in the meantime: then the disk is
  /// as full as it gets, and that is what was asked for.
  const fill = async (leave) => {
    const { bavail, bsize } = await statfs(disk);
    await writeFile(filler, Buffer.alloc(Math.max(0, bavail * bsize - leave), 1)).catch((error) => assert.equal(error.code, 'ENOSPC'));
  };
  const free = () => rm(filler, { force: true });
  const request = () => ({ scene: scene.id, ...demo.leaf, params: { intervals: 6 } });

  const notReady = async () => (await client.request('GET', '/readyz', { expect: 503 })).json().detail;
  /// Whether the service has met the full disk, and does not only see it.
  const storeIsFull = async () => {
    const ready = await client.request('GET', '/readyz', { expect: [200, 503] });
    return ready.status === 503 && /job store/.test(ready.json().detail);
  };

  /// Of an edit on a full disk. Where not even its failure can be written down, the service says so and does it later.
  const howItEnds = async (id) => {
    const patience = Date.now() + 15_000;
    let edit;
    do {
      await sleep(50);
      edit = await client.edit(id);
    } while (!finalStates.includes(edit.state) && Date.now() < patience && !(await storeIsFull()));
    const noted = finalStates.includes(edit.state);
    if (!noted) {
      assert.match(await notReady(), /full/);
      await free();
      edit = await client.ended(id, { timeout: 30_000 });
    }
    if (edit.state === 'succeeded') return 'succeeded';
    assert.equal(edit.state, 'failed');
    assert.equal(edit.error.code, 'no_space', JSON.stringify(edit.error));
    assert.equal(edit.result_version, null);
    return noted ? 'failed' : 'failed later';
  };

  test('takes no upload, and says so', async () => {
    await client.request('GET', '/readyz', { expect: 200 });
    await fill(200_000);
    assert.match(await notReady(), /the disk is full/);
    const response = await client.request('POST', '/v1/scenes', { body: demo.ply, headers: { 'content-type': 'application/octet-stream' }, expect: 507 });
    assert.equal(response.json().code, 'no_space');
    const dataset = await datasetZip(demo.folder);
    const padded = Buffer.concat([Buffer.alloc(300_000), dataset]);  // bytes before a zip are no part of it
    await client.request('PUT', `/v1/scenes/${scene.id}/dataset`, { body: padded, headers: { 'content-type': 'application/zip' }, expect: 507 });
    assert.equal((await client.get('/v1/scenes')).json().scenes.length, 1);
    assert.equal((await client.get(`/v1/scenes/${scene.id}/views`)).json().views.length, 12, 'the dataset is still there');
    await free();
    const added = await client.upload(demo.ply, { name: 'second' });
    await client.delete(`/v1/scenes/${added.id}`);
  });

  test('fails an edit with no_space, whose record says so; the next works once there is room', async () => {
    const outcomes = [];
    for (const leave of [0, 60_000, 150_000, 400_000]) {
      await fill(leave);
      const response = await client.request('POST', '/v1/edits', { json: request(), expect: [202, 507] });
      await client.get('/healthz');
      await client.get(`/v1/scenes/${scene.id}/versions/0/render`, { query: { eye: '0,-1,-4', target: '0,0,0', width: 64, height: 48 } });
      if (response.status === 507) {
        assert.equal(response.json().code, 'no_space');
        outcomes.push('refused');
      } else {
        outcomes.push(await howItEnds(response.json().id));
      }
      await free();
      const edit = await client.succeeded((await client.submit(request())).id);
      await client.file(scene.id, edit.result_version);
    }
    assert.ok(outcomes.some((outcome) => outcome.startsWith('failed')), `${outcomes}`);
    await service.alive();
  });

  test('is no reason to lose anything over a restart', async () => {
    const before = (await client.get(`/v1/scenes/${scene.id}`)).json().versions;
    const { id } = await client.submit(request());
    await client.until(id, (edit) => edit.finished_intervals.length >= 1, { every: 5 }).catch(() => {});
    await fill(0);
    await service.kill();
    await free();
    await service.start();
    client = service.client;
    const edit = await client.ended(id);
    assert.ok(edit.state === 'succeeded' || edit.error?.code === 'no_space', JSON.stringify(edit.error));
    const now = (await client.get(`/v1/scenes/${scene.id}`)).json().versions;
    assert.deepEqual(now.slice(0, before.length), before);
    assert.deepEqual(await client.file(scene.id, 0), demo.ply);
  });

  test('with a download in it does not spoil the next one', async () => {
    const whole = await client.file(scene.id, 1, 'spz');
    const { result_version: version } = await client.succeeded((await client.submit(request())).id);
    await fill(10_000);
    await client.get(`/v1/scenes/${scene.id}/versions/${version}/file`, { expect: [200, 507] });
    assert.deepEqual((await client.get(`/v1/scenes/${scene.id}/versions/1/file`, { query: { format: 'spz' } })).body, whole);
    await free();
    assert.ok((await client.file(scene.id, version)).length > demo.ply.length / 2);
  });
});
