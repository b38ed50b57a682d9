// A service with several tokens: what each of them may do, and what becomes of them when the file is another.
import assert from 'node:assert/strict';
import { readFile, rename, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { Client } from './support/client.mjs';
import { operations } from './support/contract.mjs';
import { Service, temporaryFolder } from './support/program.mjs';
import { demoScene } from './support/scenes.mjs';

const secrets = { viewer: 'secret-of-the-viewer', studio: 'secret-of-the-studio', scraper: 'secret-of-the-scraper', boss: 'secret-of-the-boss' };
const scopes = { viewer: 'read', studio: 'edit', scraper: 'admin', boss: 'edit,admin' };
const has = (name, scope) => scopes[name].split(',').some((one) => one === scope || (one === 'edit' && scope === 'read'));
const lines = (names) => `# name scopes secret\n${names.map((name) => `${name}\t${scopes[name]}  ${secrets[name]}\n`).join('')}`;

let service, file, audit;
const as = {};
before(async () => {
  file = path.join(temporaryFolder(), 'tokens');
  await writeFile(file, lines(Object.keys(secrets)), { mode: 0o600 });
  audit = path.join(temporaryFolder(), 'audit.jsonl');
  service = await Service.start({ args: ['--token-file', file, '--audit-log', audit, '--drain-seconds', '1'], token: secrets.boss });
  for (const name of Object.keys(secrets)) as[name] = new Client(service.url, { token: secrets[name] });
});
after(async () => {
  for (const client of Object.values(as)) client.close();
  await service?.stop();
});

/// What the audit log says, as objects.
const audited = async (of = audit) => (await readFile(of, 'utf8')).split('\n').filter(Boolean).map((line) => JSON.parse(line));

/// The one scope that the contract asks of a token for an operation; none: any token will do, or none.
const needed = ({ operation }) => (operation.security ?? [{ bearer: ['read'] }]).flatMap((one) => one.bearer ?? [])[0];

test('each operation asks for the scope that the contract names, and says what is missing', async () => {
  let refused = 0;
  for (const one of operations) {
    const scope = needed(one);
    if (scope === undefined || one.path.endsWith('/events')) continue;
    const real = one.path.replace('{id}', 'x000001').replace('{v}', '0').replace('{u}', '1').replace('{k}', '0');
    for (const name of Object.keys(secrets)) {
      const response = await as[name].request(one.method, real);
      const may = has(name, scope);
      assert.equal(response.status === 403, !may, `${name}: ${one.method} ${real}: ${response.status}`);
      if (may) continue;
      ++refused;
      assert.equal(response.json().code, 'forbidden');
      assert.ok(response.json().detail.startsWith(`token "${name}" may not `), response.json().detail);
      assert.ok(response.json().detail.endsWith(`it lacks the scope ${scope}`), response.json().detail);
      assert.equal(response.headers['www-authenticate'], `Bearer error="insufficient_scope", scope="${scope}"`);
    }
  }
  assert.ok(refused >= 40, `only ${refused} were refused`);
});

describe('with a scene', () => {
  let demo, scene, edit;
  before(async () => {
    demo = await demoScene({ gaussians: 4000 });
    scene = (await as.studio.upload(demo.ply)).id;
    edit = { ...demo.ball, scene, version: 0, preset: 'draft' };
  });

  test('who may see sees all, and asks what an edit would do', async () => {
    await as.viewer.get('/v1/scenes');
    await as.viewer.get(`/v1/scenes/${scene}/versions/0/file`, { query: { format: 'ply' } });
    await as.viewer.post(`/v1/scenes/${scene}/versions/0/pick`, { view: 'v000', x: 10, y: 10 }, { expect: [200, 404] });
    await as.viewer.post('/v1/previews', edit);
    await as.viewer.post('/v1/edits', edit, { query: { validate_only: 'true' } });
    await as.viewer.post('/v1/edits', edit, { expect: 403 });
    await as.viewer.post('/v1/edits', edit, { query: { validate_only: 'false' }, expect: 403 });
    await as.viewer.delete(`/v1/scenes/${scene}`, { expect: 403 });
    await as.scraper.get('/metrics');
    await as.scraper.get('/v1/scenes', { expect: 403 });
    assert.equal((await as.studio.succeeded((await as.studio.submit(edit)).id)).state, 'succeeded');
  });

  test('a session may do what its token may, and ends with it', async () => {
    const sessionOf = async (name) => {
      const { headers } = await as[name].request('POST', '/v1/session', { expect: 204 });
      return { cookie: headers['set-cookie'][0].split(';')[0], authorization: '' };
    };
    const page = new Client(service.url);
    const [viewer, studio] = [await sessionOf('viewer'), await sessionOf('studio')];
    await page.get('/v1/scenes', { headers: viewer });
    await page.request('PATCH', `/v1/scenes/${scene}`, { headers: viewer, json: { name: 'mine' }, expect: 403 });
    await page.request('PATCH', `/v1/scenes/${scene}`, { headers: studio, json: { name: 'mine' }, expect: 200 });

    const reread = async (text, said) => {
      await writeFile(file, text, { mode: 0o600 });
      const before = service.log.length;
      service.process.kill('SIGHUP');
      for (let i = 0; i < 200 && !service.log.slice(before).includes(said); ++i) await sleep(20);
      assert.ok(service.log.slice(before).includes(said), service.log.slice(before));
    };
    await reread(`${lines(['viewer', 'boss'])}broken line\n`, 'the old tokens stay');
    await page.get('/v1/scenes', { headers: studio });
    assert.match(service.log, new RegExp(`${file}:4`));
    await reread('viewer\n', 'the old tokens stay');
    await page.get('/v1/scenes', { headers: { authorization: 'Bearer viewer' }, expect: 401 });
    await reread(lines(['viewer', 'boss', 'scraper']), 'have been read again');
    await page.get('/v1/scenes', { headers: viewer });
    await page.get('/v1/scenes', { headers: studio, expect: 401 });
    await as.studio.get('/v1/scenes', { expect: 401 });
    scopes.viewer = 'read,admin';
    await reread(lines(Object.keys(secrets)), 'have been read again');
    await page.get('/v1/scenes', { headers: viewer, expect: 401 });
    await page.get('/v1/scenes', { headers: studio, expect: 401 });
    await as.viewer.get('/metrics');
    page.close();
  });

  test('the audit log says who changed what, and who was not let in', async () => {
    const found = await audited();
    const one = (wanted) => found.filter((line) => Object.entries(wanted).every(([name, value]) => line[name] === value));
    const [upload] = one({ token: 'studio', route: '/v1/scenes', status: 201 });
    assert.equal(upload.scene, scene);
    assert.equal(upload.address, '127.0.0.1');
    assert.ok(upload.request_id);
    const [submitted] = one({ token: 'studio', route: '/v1/edits', status: 202 });
    assert.equal(submitted.scene, scene);
    assert.match(submitted.edit, /^e\d{6}$/);
    assert.equal(one({ token: 'studio', method: 'PATCH', route: '/v1/scenes/{id}', scene, status: 200 }).length, 1);
    assert.equal(one({ token: 'viewer', method: 'DELETE', scene, status: 403, refused: 'forbidden' }).length, 1);
    assert.equal(one({ token: 'viewer', route: '/v1/session', status: 204 }).length, 1);
    assert.ok(one({ token: null, status: 401, refused: 'unauthorized' }).length >= 4);
    assert.deepEqual(one({ route: '/v1/previews', status: 200 }), [], 'a preview changes nothing');
    assert.deepEqual(found.filter(({ method, status }) => method === 'GET' && status < 400), []);
  });

  test('the audit log goes on in a new file after SIGHUP', async () => {
    await rename(audit, `${audit}.1`);
    const before = service.log.length;
    service.process.kill('SIGHUP');
    for (let i = 0; i < 200 && !service.log.slice(before).includes('has been opened again'); ++i) await sleep(20);
    await as.boss.delete(`/v1/scenes/${scene}`);
    const [line, ...more] = await audited();
    assert.deepEqual([line.token, line.method, line.scene, line.status, more.length], ['boss', 'DELETE', scene, 204, 0]);
  });

  test('a token with quotas may so much, and is told which it has used up', async () => {
    const guest = 'secret-of-the-guest';
    const mine = await as.boss.upload(demo.ply);
    const size = (await as.boss.get(`/v1/scenes/${mine.id}`)).json().disk_bytes;
    const reread = async (quotas) => {
      await writeFile(file, `${lines(Object.keys(secrets))}guest edit ${guest} ${quotas}\n`, { mode: 0o600 });
      const before = service.log.length;
      service.process.kill('SIGHUP');
      for (let i = 0; i < 200 && !service.log.slice(before).includes('have been read again'); ++i) await sleep(20);
    };
    await reread(`edits=1 bytes=${size + 100}`);
    const client = new Client(service.url, { token: guest });
    const refused = async (what, quota) => {
      const response = await what;
      assert.deepEqual([response.status, response.json().code, response.json().where], [429, 'quota_exceeded', quota], response.json().detail);
      return response;
    };
    const own = await client.upload(demo.ply);
    const { headers } = await refused(client.request('POST', '/v1/scenes', { body: demo.ply, headers: { 'content-type': 'application/octet-stream' } }), 'bytes');
    assert.equal(headers['retry-after'], undefined, 'time gives no room');
    const long = { ...demo.leaf, scene: own.id, version: 0, params: { intervals: 20, views: 20, max_image_side: 256 } };
    const first = await client.submit(long, { 'idempotency-key': 'one' });
    const again = await refused(client.request('POST', '/v1/edits', { json: long }), 'edits');
    assert.ok(Number(again.headers['retry-after']) >= 1);
    assert.equal((await client.submit(long, { 'idempotency-key': 'one' })).id, first.id, 'the same is no other');
    await as.boss.submit({ ...edit, scene: mine.id });
    await client.post(`/v1/edits/${first.id}/cancel`);
    await client.ended(first.id);
    await reread('seconds=1');
    const never = await client.request('POST', '/v1/edits', { json: { ...long, params: { ...long.params, views: 200 } } });
    assert.deepEqual([never.status, never.json().code, never.json().where, never.headers['retry-after']], [413, 'too_large', 'seconds', undefined], 'it fits on no day');
    client.close();
  });

  test('what has been worked on a day outlives a kill', async () => {
    const own = await as.boss.upload(demo.ply);
    const short = { ...demo.ball, scene: own.id, version: 0, preset: 'preview' };
    const long = { ...demo.leaf, scene: own.id, version: 0, params: { intervals: 20, views: 20, max_image_side: 400 } };
    const write = (quotas) => writeFile(file, `${lines(Object.keys(secrets))}worker edit secret-of-the-worker ${quotas}\nother edit secret-of-the-other ${quotas}\n`, { mode: 0o600 });
    await write('');
    await service.kill();
    await service.start();
    let worker = new Client(service.url, { token: 'secret-of-the-worker' });
    const estimate = (await worker.post('/v1/edits', short, { query: { validate_only: 'true' } })).json().estimate.seconds;
    let worked = 0;
    while (worked < 15) {
      const { id } = await worker.submit(long);
      await worker.until(id, ({ state }) => state !== 'queued');
      const since = performance.now();
      await worker.succeeded(id);
      worked += Math.max((performance.now() - since) / 1000 - 0.5, 0.1);
    }
    // Enough for the edit, as often as estimates may differ on a busy machine, but not beside what has been worked, which
    // the service may have seen to be less.
    const quota = Math.ceil(estimate) + Math.floor(0.6 * worked);
    await write(`seconds=${quota}`);
    for (let i = 0; i < 2; ++i) {
      await service.kill();
      await service.start();
      worker.close();
      worker = new Client(service.url, { token: 'secret-of-the-worker' });
      const { status, headers, ...refused } = await worker.request('POST', '/v1/edits', { json: short });
      assert.deepEqual([status, refused.json().code, refused.json().where], [429, 'quota_exceeded', 'seconds'], refused.json().detail);
      const now = Date.now();
      const left = 24 * 3600 - (now / 1000) % (24 * 3600);
      assert.ok(Math.abs(Number(headers['retry-after']) - left) < 30, `${headers['retry-after']} s, and it is ${left} s until midnight`);
    }
    const other = new Client(service.url, { token: 'secret-of-the-other' });
    await other.succeeded((await other.submit(short)).id);
    other.close();
    worker.close();
  });

  test('no secret is in either log', async () => {
    const all = service.log + (await readFile(audit, 'utf8')) + (await readFile(`${audit}.1`, 'utf8'));
    for (const secret of Object.values(secrets)) assert.ok(!all.includes(secret));
  });
});
