// What an operator sees of the queue, and does to it, while the service is at work: over a file, and over PostgreSQL.
import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import { Postgres, installed } from './support/postgres.mjs';
import { run, Service, temporaryFolder } from './support/program.mjs';
import { demoScene } from './support/scenes.mjs';

assert.ok(installed || !process.env.CI, 'PostgreSQL\'s server is absent in CI');

let demo;
before(async () => { demo = await demoScene({ gaussians: 5000, views: 4, size: '320x240', photos: false }); });

for (const kind of ['a file', 'PostgreSQL'])
  describe(`over ${kind}`, { skip: kind !== 'a file' && !installed && 'PostgreSQL\'s server is not on this machine (postgresql-15)' }, () => {
    const dataDir = temporaryFolder();
    let postgres, service, scene, store = [];
    before(async () => {
      if (kind !== 'a file') {
        postgres = await Postgres.start();
        store = ['--store', postgres.address];
      }
      service = await Service.start({ dataDir, args: [...store, '--edit-attempts', '1', '--threads', '1'] });
      scene = (await service.client.upload(demo.ply)).id;
    });
    after(async () => {
      await service?.stop();
      await postgres?.crash();
    });

    /// Longer than anybody looks at it.
    const endless = () => ({ scene, ...demo.leaf, params: { intervals: 20, max_image_side: 400 } });
    const long = () => ({ scene, ...demo.leaf, params: { intervals: 12, views: 4, max_image_side: 160 } });
    const admin = async (command, ...args) => (await run('admin', command, '--data-dir', dataDir, ...store, ...args)).stdout;
    const refusal = (...args) => admin(...args).then(() => assert.fail('it was done'), ({ code, stderr }) => ({ code, stderr }));
    const queue = async (...args) => JSON.parse(await admin('queue', '--json', ...args)).edits;

    test('what waits and who works is told, and the service goes on', async () => {
      assert.equal(await admin('queue'), 'no edit waits or runs\n');
      const first = await service.client.submit(endless());
      const second = await service.client.submit(endless());
      await service.client.until(first.id, ({ finished_intervals: done }) => done.length >= 1);
      const [runs, waits] = await queue();
      assert.deepEqual([runs.id, runs.state, runs.scene, waits.id, waits.state, waits.place], [first.id, 'running', scene, second.id, 'queued', 1]);
      assert.ok(runs.finished_intervals >= 1 && runs.age_seconds > 0 && runs.worked_seconds > 0, JSON.stringify(runs));
      assert.match(runs.claim.worker, new RegExp(`:${service.process.pid}$`));
      assert.ok(runs.claim.since_seconds >= 0);
      if (kind === 'a file') assert.equal(runs.claim.lease_seconds, null);
      else assert.ok(runs.claim.lease_seconds > 0 && runs.claim.lease_seconds <= 30);
      const { workers, in_use: inUse } = JSON.parse(await admin('workers', '--json'));
      assert.deepEqual(workers.map(({ edit }) => edit), [first.id]);
      assert.equal(inUse, kind === 'a file' ? true : null);
      assert.match(await admin('workers'), new RegExp(`:${service.process.pid} .*${first.id}`));
      assert.equal((await service.client.edit(first.id)).state, 'running');
      await service.client.post(`/v1/edits/${second.id}/cancel`);
      await service.client.post(`/v1/edits/${first.id}/cancel`);
      await service.client.ended(first.id);
    });

    test('an edit that failed goes on from its checkpoint', async () => {
      const { id } = await service.client.submit(long());
      await service.client.until(id, ({ finished_intervals: done }) => done.length >= 2);
      await service.kill();
      if (kind === 'a file') assert.match(await admin('workers'), /no service is at work here/);
      await service.start();
      const failed = await service.client.ended(id);
      assert.equal(failed.state, 'failed', 'the service may die of it once');
      assert.deepEqual(await queue(), []);
      const [known] = await queue('--failed');
      assert.deepEqual([known.id, known.state, known.deaths, known.claim], [id, 'failed', 1, null]);

      if (kind === 'a file') {
        const { code, stderr } = await refusal('requeue', id);
        assert.equal(code, 12);
        assert.match(stderr, /\/v1\/edits\/e\d+\/requeue/);
        const { body } = await service.client.request('POST', `/v1/edits/${id}/requeue`, { expect: 200 });
        assert.ok(JSON.parse(body).finished_intervals.length >= 2);
      } else {
        assert.match(await admin('requeue', id), new RegExp(`^${id} is queued again, after interval \\d+, from its checkpoint\n$`));
      }
      const edit = await service.client.succeeded(id);
      assert.equal(edit.finished_intervals.length, 12);
      const alone = await service.client.submit({ ...long(), version: 0 });
      const bytes = async (version) => service.client.file(scene, version);
      assert.deepEqual(await bytes(edit.result_version), await bytes((await service.client.succeeded(alone.id)).result_version), 'the same bytes');
      const { code, stderr } = await refusal('requeue', 'e000099');
      if (kind === 'a file') assert.deepEqual([code, /a service has the records open.*\/v1\/edits\/e000099\/requeue/.test(stderr)], [12, true], stderr);
      else assert.deepEqual([code, /there is no job "e000099"/.test(stderr)], [3, true], stderr);
    });
  });

test('what cannot be looked at is named', async () => {
  const dataDir = temporaryFolder();
  const failed = await run('admin', 'queue', '--data-dir', dataDir).then(() => null, (error) => error);
  assert.equal(failed.code, 3);
  assert.match(failed.stderr, /has no records of edits/);
});
