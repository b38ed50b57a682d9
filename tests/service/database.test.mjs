// The service with its records in a database: what kill.test.mjs asks of a file, while the database goes away, too.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { Postgres, installed } from './support/postgres.mjs';
import { Service } from './support/program.mjs';
import { demoScene } from './support/scenes.mjs';

assert.ok(installed || !process.env.CI, 'PostgreSQL\'s server is absent in CI');

describe('records in a database', { skip: !installed && 'PostgreSQL\'s server is not on this machine (postgresql-15)' }, () => {
  let postgres, service, scene, request, truth;
  const result = async (id) => service.client.file(scene.id, (await service.client.succeeded(id)).result_version);
  /// The first who ask may be refused as those before them were.
  const reachedAgain = async (id) => {
    for (let tries = 0; (await service.client.request('GET', `/v1/edits/${id}`, { expect: [200, 503] })).status !== 200; ++tries) {
      assert.ok(tries < 600, 'the database is not reached again');
      await sleep(50);
    }
  };
  const finished = async (id) => (await service.client.edit(id)).finished_intervals.length;
  before(async () => {
    const demo = await demoScene({ gaussians: 20_000, views: 12, size: '640x480', photos: false });
    postgres = await Postgres.start();
    service = await Service.start({ args: ['--store', postgres.address, '--edit-attempts', 1000] });
    scene = await service.client.upload(demo.ply, { name: 'killed' });
    request = { scene: scene.id, ...demo.leaf, params: { intervals: 8, max_image_side: 640 } };
    truth = await result((await service.client.submit(request)).id);
  });
  after(async () => {
    await service?.stop();
    await postgres?.crash();
  });

  test('killed at each interval, an edit goes on at once and ends with the same bytes', async () => {
    const { id } = await service.client.submit(request, { 'idempotency-key': 'killed' });
    for (const intervals of [1, 3, 5, 7]) {
      await service.client.until(id, (edit) => edit.finished_intervals.length >= intervals, { every: 5 });
      await service.kill();
      await service.start();
      assert.ok(await finished(id) >= intervals, 'what was finished stays so');
    }
    assert.equal((await service.client.submit(request, { 'idempotency-key': 'killed' })).id, id);
    assert.deepEqual(await result(id), truth);
    assert.ok(!existsSync(path.join(service.dataDir, 'edits/jobs.db')));
  });

  test('a database that goes away in the middle of an edit costs nothing but time', async () => {
    const { id } = await service.client.submit(request);
    for (const intervals of [1, 4]) {
      await service.client.until(id, (edit) => edit.finished_intervals.length >= intervals, { every: 5 });
      await postgres.crash();
      const refused = await service.client.request('GET', `/v1/edits/${id}`, { expect: 503 });
      assert.equal(refused.json().code, 'unavailable');
      const refusal = await service.client.request('POST', '/v1/edits', { json: request, expect: 503 });
      for (const { body } of [refused, refusal]) assert.doesNotMatch(body.toString(), /secret|tests@|postgresql:|\/tmp/);
      await service.client.get('/healthz');
      await service.client.get(`/v1/scenes/${scene.id}`);
      await postgres.start();
      await reachedAgain(id);
    }
    const before = (await service.client.get('/v1/edits')).json().edits.length;
    assert.deepEqual(await result(id), truth);
    assert.equal((await service.client.get('/v1/edits')).json().edits.length, before, 'what was refused is not there');
    await service.client.get('/readyz');
  });

  test('two services do not share a database', async () => {
    await assert.rejects(Service.start({ args: ['--store', postgres.address] }), /another process has this job store open/);
    await service.stop();
    const other = Service.start({ args: ['--store', postgres.address] });
    await assert.rejects(other, (error) => /the job store belongs to somebody else \(data folder .*\)/.test(error.message) && !/secret/.test(error.message));
    await service.start();
    assert.equal((await service.client.get('/v1/edits')).json().edits.length, 3);
  });
});
