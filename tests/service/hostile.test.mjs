// Wrong requests and rude clients. Each is told what is wrong and where; the service lives on, and nothing is lost.
import assert from 'node:assert/strict';
import { mkdir, symlink, writeFile } from 'node:fs/promises';
import net from 'node:net';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { Client } from './support/client.mjs';
import { named, operations, summary } from './support/contract.mjs';
import { form, formType } from './support/form.mjs';
import { mutations } from './support/mutations.mjs';
import { Service, temporaryFolder } from './support/program.mjs';
import { exchange } from './support/raw.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';
import { zip } from './support/zip.mjs';

const octets = { 'content-type': 'application/octet-stream' };
const limits = { upload: 3_000_000, dataset: 16_000_000, queue: 3, streams: 2, side: 1024 };

let demo, root, service, client, scene, edit, dataset;
let kept;  // what must still be there, unchanged, after everything
before(async () => {
  demo = await demoScene();
  root = temporaryFolder();
  await mkdir(path.join(root, 'inside'));
  await writeFile(path.join(root, 'inside', 'scene.ply'), demo.ply);
  await symlink('/etc', path.join(root, 'inside', 'out'));
  await symlink('/etc/passwd', path.join(root, 'inside', 'passwd.ply'));
  service = await Service.start({ args: ['--scene-root', path.join(root, 'inside'), '--max-upload-bytes', limits.upload,
    '--max-dataset-bytes', limits.dataset, '--max-queued', limits.queue, '--max-streams', limits.streams,
    '--max-render-side', limits.side] });
  client = service.client;
  scene = await client.upload(demo.ply, { name: 'demo' });
  dataset = await datasetZip(demo.folder);
  scene = await client.putDataset(scene.id, dataset);
  edit = await client.succeeded((await client.submit({ scene: scene.id, ...demo.ball })).id);
  kept = await inventory();
});
after(async () => {
  console.log(`${summary()}`);
  await service?.stop();
});

const inventory = async () => ({
  scenes: (await client.get('/v1/scenes')).json().scenes.map(({ memory_bytes: _, disk_bytes: __, ...rest }) => rest),
  edits: (await client.get('/v1/edits')).json().edits,
  files: [await client.file(scene.id, 0), await client.file(scene.id, 1)],
});
/// Fails unless the service is well and holds what it held.
const unharmed = async () => {
  await service.alive();
  assert.deepEqual(await inventory(), kept);
};
/// Expects a problem of this code.
///   where  what its address begins with
const refused = async (response, code, where) => {
  const problem = (await response).json();
  assert.equal(problem.code, code, problem.detail);
  if (where !== undefined) assert.ok((problem.where ?? '').startsWith(where), `where is ${problem.where}, expected ${where}: ${problem.detail}`);
  return problem;
};

describe('a body that is not what the contract asks for', () => {
  const base = () => ({
    scene: scene.id, version: 0, mode: 'move', preset: 'draft', prompt: 'a ball',
    handles: [{ ...demo.ball.handles[0], group: 0 }, { source: demo.ball.handles[0].source, radius: 0.2 }],
    region: { center: [0, 0, 0], size: [9, 9, 9] },
    params: { intervals: 2, annealing_steps: 1, strength_initial: 0.5, strength_final: 0.3, annealing: 'linear', iterations: 5, views: 4, exclude_views: ['view_00.png'],
      max_image_side: 64, corrector: 'none', perceptual: 'msssim', rotation: 'paper', interpolation: 'paper', rotate_sh: true, background: 'render', seed: 1 },
  });
  const at = (end) => `/v1/scenes/${scene.id}${end}`;
  const cases = {
    'an edit': () => ['POST', '/v1/edits', 'EditRequest', base()],
    'a preview': () => ['POST', '/v1/previews', 'EditRequest', base()],
    'a render by view': () => ['POST', at('/versions/0/render'), 'RenderRequest',
      { view: 'view_00.png', what: 'color', format: 'png', max_side: 32, background: [0, 0, 0], sh_degree: 0, quality: 50 }],
    'a render by look-at': () => ['POST', at('/versions/0/render'), 'RenderRequest',
      { camera: { eye: [0, 0, -3], target: [0, 0, 0], up: [0, -1, 0], fov_y_deg: 50, width: 32, height: 24 } }],
    'a render by pinhole': () => ['POST', at('/versions/0/render'), 'RenderRequest',
      { camera: { width: 32, height: 24, fx: 30, fy: 30, cx: 16, cy: 12, cam_from_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3]] } }],
    'a pick': () => ['POST', at('/versions/0/pick'), 'PickRequest', { view: 'view_00.png', x: 3.5, y: 4.5, radius: 0.1 }],
    'a count': () => ['POST', at('/versions/0/pick'), 'PickRequest', { point: [0, 0, 0], radius: 0.1 }],
    'a change': () => ['PATCH', at(''), 'ScenePatch', { name: 'other', up: [0, 1, 0] }],
    'a scene by path': () => ['POST', '/v1/scenes', 'SceneByPath', { path: 'scene.ply', name: 'other' }],
    'a dataset by path': () => ['PUT', at('/dataset'), 'DatasetByPath', { path: 'nothing' }],
  };
  for (const [name, make] of Object.entries(cases))
    test(`${name}: each field missing, unknown, doubled, of a wrong type or out of range`, async () => {
      const [method, target, schema, right] = make();
      const wrong = mutations(named(schema), right);
      assert.ok(wrong.length > 30);
      const faults = [];
      for (let i = 0; i < wrong.length; i += 32)
        await Promise.all(wrong.slice(i, i + 32).map(async ({ text, where, what }) => {
          const response = await client.request(method, target, { body: text, headers: { 'content-type': 'application/json' } });
          const problem = response.status >= 400 ? response.json() : {};
          const found = problem.where ?? '';
          if (response.status !== 400 || problem.code !== 'invalid_argument') faults.push(`${what}: ${response.status} ${problem.code} ${problem.detail}`);
          else if (!found.startsWith(where) && !found.startsWith('line ')) faults.push(`${what}: where is "${found}", expected "${where}": ${problem.detail}`);
        }));
      assert.deepEqual(faults, []);
      await unharmed();
    });

  test('text that is no JSON, is cut off, nested too deep or too long', async () => {
    const send = (body) => client.request('POST', '/v1/edits', { body, headers: { 'content-type': 'application/json' } });
    const right = JSON.stringify(base());
    for (let length = 0; length < right.length; length += 7) await refused(send(right.slice(0, length)), 'invalid_argument');
    for (const text of ['{', '}', '{"a":1}{"b":2}', '\xff\xfe', '\u0000', '[[[[', '"', '{"a"}', "{'a':1}", '{"handles":[],}', '// no', '\ufeff{}'])
      await refused(send(Buffer.from(text, 'latin1')), 'invalid_argument');
    await refused(send('['.repeat(17) + ']'.repeat(17)), 'too_large');
    await refused(send('['.repeat(500_000)), 'too_large');
    await refused(send(`{"scene":"${'x'.repeat(1 << 20)}"}`), 'too_large');
    await refused(send(right.padEnd((1 << 20) + 1)), 'too_large');
    await unharmed();
  });

  test('limits on what is inside', async () => {
    const handles = Array.from({ length: 257 }, () => base().handles[1]);
    const many = await client.post('/v1/edits', { ...base(), handles }, { expect: [400, 413] });
    assert.match(many.json().where, /^handles/);
    const big = { camera: { eye: [0, 0, -3], target: [0, 0, 0], width: limits.side + 1, height: 24 } };
    const huge = await client.post(at('/versions/0/render'), big, { expect: [400, 413] });
    assert.match(huge.json().detail, new RegExp(`${limits.side}`));
    await client.post(at('/versions/0/render'), { camera: { ...big.camera, width: 2147483647, height: 2147483647 } }, { expect: [400, 413] });
    await client.post(at('/versions/0/render'), { camera: { ...big.camera, width: limits.side } }, { expect: 200 });
    await refused(client.request('PATCH', at(''), { json: { name: 'ü'.repeat(101) } }), 'invalid_argument', 'name');
    await unharmed();
  });

  test('cameras that look nowhere', async () => {
    const lookAt = (change) => client.post(at('/versions/0/render'), { camera: { eye: [0, 0, -3], target: [0, 0, 0], up: [0, -1, 0], width: 8, height: 8, ...change } }, { expect: 400 });
    const pinhole = (change) => client.post(at('/versions/0/render'), { camera: { width: 8, height: 8, fx: 9, fy: 9, cx: 4, cy: 4, cam_from_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3]], ...change } }, { expect: 400 });
    await refused(lookAt({ target: [0, 0, -3] }), 'invalid_argument', 'camera');
    await refused(lookAt({ up: [0, 0, 0] }), 'invalid_argument', 'camera');
    await refused(lookAt({ fx: 4 }), 'invalid_argument', 'camera');
    await refused(pinhole({ cam_from_world: [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]] }), 'invalid_argument', 'camera.cam_from_world');
    await refused(pinhole({ cam_from_world: [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]] }), 'invalid_argument', 'camera.cam_from_world');
    await refused(pinhole({ cam_from_world: [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]] }), 'invalid_argument', 'camera.cam_from_world');
    await refused(client.post(at('/versions/0/render'), { view: 'no such.png' }, { expect: 404 }), 'not_found');
    await refused(client.post(at('/versions/0/render'), { view: 'view_00.png', camera: { eye: [0, 0, -3], target: [0, 0, 0], width: 8, height: 8 } }, { expect: 400 }), 'invalid_argument');
    await refused(client.post(at('/versions/0/pick'), { view: 'view_00.png', x: -1, y: 5 }, { expect: 400 }), 'invalid_argument', 'x');
    await refused(client.post(at('/versions/0/pick'), { view: 'view_00.png', x: 5, y: 241 }, { expect: 400 }), 'invalid_argument', 'y');
    await refused(client.post(at('/versions/0/pick'), { view: 'view_00.png', x: 5, y: 5, point: [0, 0, 0], radius: 1 }, { expect: 400 }), 'invalid_argument');
  });

  test('edits that cannot be done on this scene', async () => {
    const far = { ...base(), handles: [{ source: [100, 0, 0], target: [101, 0, 0], radius: 0.1 }] };
    for (const target of ['/v1/edits', '/v1/edits?validate_only=true', '/v1/previews']) {
      const problem = await refused(client.request('POST', target, { json: far, expect: 422 }), 'unprocessable', 'handles[0]');
      assert.match(problem.detail, /nearest/);
      await refused(client.request('POST', target, { json: { ...base(), scene: 's999999' }, expect: 404 }), 'not_found', 'scene');
      await refused(client.request('POST', target, { json: { ...base(), version: 77 }, expect: 404 }), 'not_found', 'version');
    }
    await refused(client.request('POST', '/v1/edits', { query: { validate_only: 'maybe' }, json: base(), expect: 400 }), 'invalid_argument', 'validate_only');
    const long = await client.request('POST', '/v1/edits', { json: base(), headers: { 'idempotency-key': 'k'.repeat(201) }, expect: 400 });
    assert.equal(long.json().where, 'Idempotency-Key');
    const empty = await client.request('POST', '/v1/edits', { json: base(), headers: { 'idempotency-key': '' }, expect: 400 });
    assert.equal(empty.json().where, 'Idempotency-Key');
    await unharmed();
  });
});

describe('a query that is wrong', () => {
  const render = (query) => client.request('GET', `/v1/scenes/${scene.id}/versions/0/render`, { query });
  test('names the parameter', async () => {
    const look = { eye: '0,-1,-4', target: '0,0,0', width: '64', height: '48' };
    for (const name of Object.keys(look)) {
      const { [name]: _, ...rest } = look;
      await refused(render(rest), 'invalid_argument');
    }
    const wrongNumbers = ['', 'x', 'nan', 'inf', '1e999', '0x10', '1;2', '1,2', ' 1', '-1', '0', '1.5', '１', '\u0000'];
    const wrongPoints = ['', 'x', '1,2', '1,2,3,4', '1,nan,3', '1,inf,3', '1,2,1e999', '1,2,1e13', '1;2;3', '1,,3', '1, ,3', '1,2,3x', '0x1,2,3'];
    for (const [names, values] of [[['width', 'height'], wrongNumbers], [['eye', 'target'], wrongPoints]])
      for (const name of names) for (const value of values) await refused(render({ ...look, [name]: value }), 'invalid_argument', name);
    for (const [name, values] of Object.entries({ what: ['colour', '', 'color,depth'], format: ['gif', 'image/png', ''], max_side: ['0', '-1', 'x'], background: ['2,0,0', '1,1', 'red', '-1,0,0'],
      sh_degree: ['4', '-1', 'x', '1.5'], quality: ['0', '101', 'best'], fov: ['0', '180', '-5', 'wide', '1e999'], up: ['0,0,0', '0,1', 'y'] }))
      for (const value of values) await refused(render({ ...look, [name]: value }), 'invalid_argument', name);
    await refused(render({ view: 'view_00.png', ...look }), 'invalid_argument');
    await refused(render({ ...look, colour: 'red' }), 'invalid_argument', 'colour');
    await refused(client.request('GET', `/v1/scenes/${scene.id}/versions/0/render?view=view_00.png&what=color&what=depth`), 'invalid_argument', 'what');
    await refused(client.get('/v1/edits', { query: { limit: '0' }, expect: 400 }), 'invalid_argument', 'limit');
    await refused(client.get('/v1/edits', { query: { limit: '1001' }, expect: 400 }), 'invalid_argument', 'limit');
    await refused(client.get('/v1/edits', { query: { active: 'perhaps' }, expect: 400 }), 'invalid_argument', 'active');
    await refused(client.get(`/v1/scenes/${scene.id}/versions/0/file`, { query: { format: 'obj' }, expect: 400 }), 'invalid_argument', 'format');
    await refused(client.get(`/v1/edits/${edit.id}/intervals/1/renders/0`, { expect: 400 }), 'invalid_argument', 'stage');
    await unharmed();
  });

  test('an unknown id is not found, whatever it looks like', async () => {
    const ids = ['s999999', 'e999999', '0', '-1', 'x'.repeat(300), '%2e%2e', '%2e%2e%2f%2e%2e%2fetc', '%00', '..%5c..', "'%20OR%201=1", 's000001%2f..', '%F0%9F%98%80', '%ff'];
    for (const id of ids)
      for (const target of [`/v1/scenes/${id}`, `/v1/scenes/${id}/views`, `/v1/scenes/${id}/versions/0/file`, `/v1/edits/${id}`, `/v1/scenes/${scene.id}/versions/${id}/file`,
        `/v1/edits/${id}/events`, `/v1/edits/${edit.id}/intervals/${id}/renders/0?stage=before`]) {
        if (id === '0' && target.includes('versions/0/file') && target.includes(scene.id)) continue;
        const response = await exchange(service.url, [`GET ${target} HTTP/1.1\r\nHost: ${service.url.host}\r\nConnection: close\r\n\r\n`]);
        assert.ok([400, 404].includes(response.status), `${target}: ${response.status}`);
        assert.ok(!response.body.includes('root:x:'), target);
        assert.match(response.headers['content-type'], /^application\/problem\+json/, target);
      }
    for (const order of ['stop', 'cancel']) await refused(client.request('POST', `/v1/edits/e999999/${order}`), 'not_found');
    await refused(client.request('DELETE', '/v1/edits/e999999'), 'not_found');
    await refused(client.request('DELETE', '/v1/scenes/s999999'), 'not_found');
    await unharmed();
  });
});

describe('a file that is wrong', () => {
  const upload = (body, headers = octets) => client.request('POST', '/v1/scenes', { body, headers });
  const put = (body) => client.request('PUT', `/v1/scenes/${scene.id}/dataset`, { body, headers: { 'content-type': 'application/zip' } });

  test('a scene file cut off, padded, poisoned or lying about itself', async () => {
    const end = demo.ply.indexOf('end_header\n') + 11;
    for (const length of [0, 1, 3, 10, end - 5, end, end + 1, end + 100, demo.ply.length - 1]) {
      const response = await upload(demo.ply.subarray(0, length));
      assert.ok([400, 422].includes(response.status), `${length} bytes: ${response.status}`);
    }
    const header = demo.ply.subarray(0, end).toString('latin1');
    const lying = (count) => Buffer.concat([Buffer.from(header.replace(/element vertex \d+/, `element vertex ${count}`)), demo.ply.subarray(end)]);
    for (const count of ['0', '5020', '4294967295', '18446744073709551615', '-1', '99999999999999999999999', 'many']) {
      const response = await upload(lying(count));
      assert.ok([400, 413, 422].includes(response.status), `${count} vertices: ${response.status} ${response.body}`);
    }
    const poisoned = Buffer.from(demo.ply);
    poisoned.writeFloatLE(NaN, end);
    const problem = await refused(upload(poisoned), 'corrupt_data');
    assert.match(problem.where, /vertex\[0\]/);
    for (const junk of [Buffer.alloc(1000), Buffer.from('hello'), Buffer.from('<svg/>'), Buffer.from('\x1f\x8b\x08'), zip([])]) {
      const response = await upload(junk);
      assert.ok([400, 422].includes(response.status), `${junk.subarray(0, 8)}: ${response.status}`);
    }
    await unharmed();
  });

  test('a damaged picture: the client hears our words, and the log stays one of JSON lines', async () => {
    const { views } = (await client.get(`/v1/scenes/${scene.id}/views`)).json();
    const { body: png } = await client.get(`/v1/scenes/${scene.id}/versions/0/render`, { query: { view: views[0].name, what: 'alpha', format: 'png' } });
    const damaged = Buffer.from(png);
    damaged[png.indexOf('IDAT') + 8] ^= 0xff;
    const bitmap = Buffer.concat([Buffer.from('BM'), Buffer.alloc(60)]);
    for (const [image, code, words] of [[damaged, 'corrupt_data', /this PNG picture is damaged: its pixels cannot be decoded/], [bitmap, 'unsupported', /is not a PNG, JPEG, EXR, TIFF or WebP picture/]]) {
      const masks = [{ view: views[0].name, image: image.toString('base64') }];
      const problem = await refused(client.post(`/v1/scenes/${scene.id}/versions/0/select`, { selection: [{ masks }] }, { expect: 422 }), code, 'selection[0].masks[0].image');
      assert.match(problem.detail, words);
    }
    await unharmed();
    const lines = service.log.slice(service.log.indexOf('\n') + 1).split('\n').filter((line) => line !== '' && !line.startsWith('splatdrag '));
    const entries = lines.slice(0, -1).map((line) => JSON.parse(line));  // the last may still be on its way
    assert.ok(entries.some(({ message, said }) => message === 'a library complains' && said.startsWith('libpng ')));
  });

  test('a scene as far out as its numbers go', async () => {
    const end = demo.ply.indexOf('end_header\n') + 11;
    const stride = (demo.ply.length - end) / Number(/element vertex (\d+)/.exec(demo.ply.subarray(0, end).toString('latin1'))[1]);
    const [some, all] = [Buffer.from(demo.ply), Buffer.from(demo.ply)];
    for (const at of [0, 4, 8]) {
      some.writeFloatLE(3e38, end + at);
      some.writeFloatLE(-3e38, end + stride + at);
      for (let row = end; row < all.length; row += stride) all.writeFloatLE(row % (2 * stride) < stride ? 3e38 : 2e38, row + at);
    }
    for (const far of [some, all]) {
      const { id, bounds } = (await client.request('POST', '/v1/scenes', { body: far, headers: octets, expect: 201 })).json();  // held against the contract
      assert.ok(bounds.high[0] > 2.9e38, `bounds ${JSON.stringify(bounds)}`);
      await client.get('/v1/scenes');
      await client.get(`/v1/scenes/${id}/views`);
      const everything = await client.post(`/v1/scenes/${id}/versions/0/select`, { selection: [{ rows: [[0, 2]] }] });
      assert.equal(everything.status, 200);
      await client.delete(`/v1/scenes/${id}`);
    }
    await unharmed();
  });

  test('a file beyond the limit, also when its length is not told', async () => {
    const problem = await refused(upload(Buffer.alloc(limits.upload + 1)), 'too_large');
    assert.match(problem.detail, /upload/);
    const chunk = Buffer.alloc(1 << 20, 'x');
    const head = `POST /v1/scenes HTTP/1.1\r\nHost: ${service.url.host}\r\nContent-Type: application/octet-stream\r\nTransfer-Encoding: chunked\r\n\r\n`;
    const chunks = Array.from({ length: 5 }, () => Buffer.concat([Buffer.from(`${chunk.length.toString(16)}\r\n`), chunk, Buffer.from('\r\n')]));
    const response = await exchange(service.url, [head, ...chunks, '0\r\n\r\n']);
    assert.ok(response.status === 413 || (response.status === 0 && response.closed), `${response.status}`);
    await unharmed();
  });

  test('a form without a file, with several, or broken', async () => {
    const send = (body, type = formType) => upload(body, { 'content-type': type });
    const file = { name: 'file', filename: 'a.ply', bytes: demo.ply };
    await refused(send(form([])), 'invalid_argument');
    await refused(send(form([{ name: 'a', bytes: 'text' }])), 'invalid_argument');
    await refused(send(form([file, file])), 'invalid_argument');
    await refused(send(form([file]).subarray(0, 5000)), 'invalid_argument');
    await refused(send(form([file]), 'multipart/form-data'), 'invalid_argument');
    await refused(send(form([file]), 'multipart/form-data; boundary=other'), 'invalid_argument');
    await refused(send(Buffer.alloc(0)), 'invalid_argument');
    const odd = (await client.request('POST', '/v1/scenes', { body: form([{ ...file, filename: '../../../etc/cron.d/x.ply' }]), headers: { 'content-type': formType }, expect: 201 })).json();
    assert.doesNotMatch(odd.name, /[/\\]/);
    await client.delete(`/v1/scenes/${odd.id}`);
    await unharmed();
  });

  test('a zip that leads out of its folder, holds links, bombs or lies', async () => {
    const good = { name: 'sparse/0/cameras.txt', bytes: Buffer.from('1 PINHOLE 32 24 30 30 16 12\n') };
    for (const name of ['../evil', '/tmp/evil', 'a/../../evil', '..\\evil', 'C:\\evil', 'sparse/../../evil', './../evil'])
      await refused(put(zip([good, { name, bytes: Buffer.from('x') }])), 'invalid_argument');
    await refused(put(zip([good, { name: 'images', bytes: Buffer.from('/etc'), mode: 0o120777, deflate: false }])), 'invalid_argument');
    await refused(put(zip([good, { name: 'device', bytes: Buffer.alloc(0), mode: 0o020666, deflate: false }])), 'invalid_argument');
    const zeros = Buffer.alloc(limits.dataset + 1);
    await refused(put(zip([good, { name: 'bomb', bytes: zeros }])), 'too_large');
    const lying = await put(zip([good, { name: 'bomb', bytes: zeros, claimedSize: 10 }]));
    assert.ok([413, 422].includes(lying.status), `a bomb that claims 10 bytes: ${lying.status}`);
    const several = await put(zip([good, ...Array.from({ length: 20 }, (_, i) => ({ name: `bomb${i}`, bytes: Buffer.alloc(1 << 20) }))]));
    assert.equal(several.status, 413);
    const claimed = await put(zip([good, { name: 'big', bytes: Buffer.from('x'), claimedSize: 0xfffffff0 }]));
    assert.ok([404, 413, 422].includes(claimed.status), `an entry that claims 4 GB and has a byte: ${claimed.status}`);
    await refused(put(zip([good, { name: 'secret', bytes: Buffer.from('x'), encrypted: true }])), 'unsupported');
    await refused(put(zip([good, { name: 'wrong', bytes: Buffer.from('x'), crc: 1 }])), 'corrupt_data');
    for (const length of [0, 1, 30, Math.floor(dataset.length / 2), dataset.length - 1]) {
      const response = await put(dataset.subarray(0, length));
      assert.ok([400, 422].includes(response.status), `${length} bytes: ${response.status}`);
    }
    await refused(put(demo.ply), 'corrupt_data');
    await unharmed();
  });

  test('a dataset that lacks a file says which', async () => {
    const lacking = await put(zip([{ name: 'sparse/0/cameras.txt', bytes: Buffer.from('1 PINHOLE 32 24 30 30 16 12\n') }]));
    assert.ok([404, 422].includes(lacking.status), `${lacking.status}`);
    assert.match(lacking.json().where + lacking.json().detail, /images\.(txt|bin)/);
    const empty = await put(zip([]));
    assert.ok([400, 404, 422].includes(empty.status), `${empty.status}`);
    await unharmed();
  });

  test('a path that leads out of the scene root', async () => {
    for (const name of ['../secret.ply', '/etc/passwd', 'out/passwd', 'passwd.ply', 'out', '..', 'a/../../x', '../inside/../../x', 'scene.ply\u0000.png', '\\\\host\\share', 'file:///etc/passwd'])
      for (const [method, target] of [['POST', '/v1/scenes'], ['PUT', `/v1/scenes/${scene.id}/dataset`]]) {
        const response = await client.request(method, target, { json: { path: name } });
        assert.ok([400, 404].includes(response.status), `${name}: ${response.status}`);
        assert.ok(!response.body.includes('root:x:'), name);
      }
    await refused(client.post('/v1/scenes', { path: 'missing.ply' }, { expect: 404 }), 'not_found');
    await unharmed();
  });
});

describe('a request that HTTP itself refuses', () => {
  test('a path that leads out, raw over a socket', async () => {
    for (const target of ['/../../../../etc/passwd', '/%2e%2e/%2e%2e/%2e%2e/etc/passwd', '/..%2f..%2f..%2fetc%2fpasswd', '//etc/passwd', '/..\\..\\etc\\passwd', '/app.js/../../../etc/passwd',
      '/v1/scenes/../../../../etc/passwd', '/%00', '/%', '/%zz', '/%c0%ae%c0%ae/etc/passwd', '*', 'etc/passwd', 'http://other.example/etc/passwd']) {
      const { status, body, headers } = await exchange(service.url, [`GET ${target} HTTP/1.1\r\nHost: ${service.url.host}\r\nConnection: close\r\n\r\n`]);
      assert.ok([400, 403, 404, 421].includes(status), `${target}: ${status}`);
      assert.ok(!body.includes('root:x:'), target);
      assert.match(headers['content-type'], /problem\+json/, target);
    }
    await unharmed();
  });

  test('heads and bodies that are broken, too long or read in two ways', async () => {
    const host = `Host: ${service.url.host}\r\n`;
    const json = 'Content-Type: application/json\r\n';
    const broken = {
      'no host': ['GET / HTTP/1.1\r\n\r\n', [400, 421]],
      'two hosts': [`GET / HTTP/1.1\r\n${host}Host: evil.example\r\n\r\n`, [400, 421]],
      'not HTTP': ['hello\r\n\r\n', [400]],
      'a binary greeting': ['\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n', [400]],
      'no version': [`GET /\r\n${host}\r\n`, [400, 505]],
      'another version': [`GET / HTTP/3.7\r\n${host}\r\n`, [400, 505]],
      'a long target': [`GET /${'x'.repeat(20_000)} HTTP/1.1\r\n${host}\r\n`, [400, 414, 431]],
      'a long header': [`GET / HTTP/1.1\r\n${host}X: ${'x'.repeat(100_000)}\r\n\r\n`, [400, 431]],
      'many headers': [`GET / HTTP/1.1\r\n${host}${'X: y\r\n'.repeat(5000)}\r\n`, [400, 431]],
      'a folded header': [`GET / HTTP/1.1\r\n${host}X: a\r\n b\r\n\r\n`, [400]],
      'a space before the colon': [`GET / HTTP/1.1\r\n${host}Content-Length : 5\r\n\r\n`, [400]],
      'a negative length': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Content-Length: -5\r\n\r\n{}`, [400]],
      'a length that is no number': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Content-Length: 2x\r\n\r\n{}`, [400]],
      'two lengths': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Content-Length: 2\r\nContent-Length: 20\r\n\r\n{}`, [400]],
      'a length and chunks': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n`, [400]],
      'a length beyond all': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Content-Length: 99999999999999999999\r\n\r\n{}`, [400, 413]],
      'a body beyond the limit': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Content-Length: 2000000\r\n\r\n{}`, [413]],
      'a bad chunk': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Transfer-Encoding: chunked\r\n\r\nzz\r\n{}\r\n0\r\n\r\n`, [400]],
      'an endless chunk': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Transfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\n{}\r\n`, [400, 408, 413]],
      'a strange coding': [`POST /v1/edits HTTP/1.1\r\n${host}${json}Transfer-Encoding: gzip\r\n\r\n`, [400, 501]],
    };
    await Promise.all(Object.entries(broken).map(async ([name, [text, statuses]]) => {
      const { status, closed } = await exchange(service.url, [Buffer.from(text, 'latin1')]);
      assert.ok(statuses.includes(status) || (status === 0 && closed), `${name}: ${status}`);
    }));
    const chunked = await exchange(service.url, [`POST /v1/edits HTTP/1.1\r\n${host}${json}Transfer-Encoding: chunked\r\nConnection: close\r\n\r\n2\r\n{}\r\n0\r\n\r\n`]);
    assert.equal(chunked.status, 400, 'chunks as such are fine');
    assert.match(chunked.body.toString(), /handles|scene/);
    await unharmed();
  });

  test('a body that ends early', async () => {
    for (const [method, target, type] of [['POST', '/v1/edits', 'application/json'], ['POST', '/v1/scenes', 'application/octet-stream'], ['PUT', `/v1/scenes/${scene.id}/dataset`, 'application/zip']]) {
      const head = `${method} ${target} HTTP/1.1\r\nHost: ${service.url.host}\r\nContent-Type: ${type}\r\nContent-Length: 1000\r\n\r\n`;
      const { status, closed } = await exchange(service.url, [head, 'half of it'], { halfClose: true });
      assert.ok([400, 408].includes(status) || (status === 0 && closed), `${target}: ${status}`);
    }
    await unharmed();
  });

  test('methods and media types that a route does not take', async () => {
    for (const target of new Set(operations.map(({ path: template }) => template))) {
      const real = target.replace('{id}', target.includes('edits') ? edit.id : scene.id).replace('{v}', '0').replace('{u}', '1').replace('{k}', '0');
      const own = operations.filter((operation) => operation.path === target).map(({ method }) => method);
      for (const method of ['GET', 'POST', 'PUT', 'PATCH', 'DELETE']) {
        if (own.includes(method)) continue;
        const response = await client.request(method, real, { expect: 405 });
        for (const allowed of own) assert.match(response.headers.allow, new RegExp(`\\b${allowed}\\b`), `${method} ${real}`);
      }
    }
    await client.request('GET', '/v1/nothing', { expect: 404 });
    await client.request('POST', '/v2/scenes', { expect: 404 });
    for (const type of ['text/plain', 'application/x-www-form-urlencoded', 'application/octet-stream', 'application/jsonp', ''])
      for (const target of ['/v1/edits', '/v1/previews', `/v1/scenes/${scene.id}/versions/0/pick`, `/v1/scenes/${scene.id}/versions/0/render`])
        await client.request('POST', target, { body: JSON.stringify({ scene: scene.id, ...demo.ball }), headers: type ? { 'content-type': type } : {}, expect: 415 });
    await client.request('PATCH', `/v1/scenes/${scene.id}`, { body: '{"name":"x"}', headers: { 'content-type': 'text/plain' }, expect: 415 });
    await unharmed();
  });

  test('ranges and ETags that make no sense', async () => {
    const file = `/v1/scenes/${scene.id}/versions/0/file`;
    const unsatisfied = await client.get(file, { headers: { range: `bytes=${demo.ply.length}-` }, expect: 416 });
    assert.equal(unsatisfied.headers['content-range'], `bytes */${demo.ply.length}`);
    for (const range of ['bytes=', 'bytes=-', 'bytes=5-2', 'bytes=x-y', 'lines=1-2', 'bytes 1-2', 'bytes=-0', 'bytes=1-2,4-5,7-9', 'bytes=0-0,0-0,0-0,0-0', `bytes=${'9'.repeat(30)}-`, 'bytes=--5', '']) {
      const response = await client.get(file, { headers: { range }, expect: [200, 206, 416] });
      if (response.status === 200) assert.deepEqual(response.body, demo.ply, range);
    }
    for (const etag of ['garbage', '"open', '""', 'W/', ',,,', `"${'x'.repeat(5000)}"`, '"a" "b"']) await client.get(file, { headers: { 'if-none-match': etag }, expect: [200, 400] });
    await client.get(file, { headers: { 'if-none-match': '*' }, expect: 304 });
    await unharmed();
  });

  test('a foreign website, or a name that is not this machine', async () => {
    const edits = { json: { scene: scene.id, ...demo.ball } };
    for (const origin of ['http://evil.example', 'https://evil.example:8080', 'null', `http://127.0.0.1.evil.example:${service.url.port}`, 'http://localhost:1', 'file://']) {
      await refused(client.request('POST', '/v1/edits', { ...edits, headers: { origin } }), 'forbidden');
      await refused(client.request('GET', '/v1/scenes', { headers: { origin } }), 'forbidden');
    }
    for (const host of ['evil.example', `evil.example:${service.url.port}`, '10.0.0.1', 'localhost.evil.example', `127.0.0.1@evil.example`, '[::ffff:7f00:1].evil'])
      await refused(client.request('GET', '/v1/scenes', { headers: { host } }), 'misdirected_request');
    await client.get('/v1/scenes', { headers: { origin: service.url.origin } });
    await client.get('/v1/scenes', { headers: { host: `localhost:${service.url.port}` } });
    await unharmed();
  });
});

describe('a client that is rude', () => {
  const open = () => new Promise((done, failed) => {
    const socket = net.connect(Number(service.url.port), service.url.hostname, () => done(socket));
    socket.on('error', failed);
  });
  /// Milliseconds until the other side closes.
  const closed = (socket, timeout = 20_000) => new Promise((done, failed) => {
    const start = Date.now();
    const timer = setTimeout(() => failed(new Error(`still open after ${timeout} ms`)), timeout);
    socket.on('close', () => { clearTimeout(timer); done(Date.now() - start); });
    socket.on('error', () => {});
    socket.resume();
  });

  test('silence, a head without end and a body without end are cut off', async () => {
    const silent = await open();
    const slowHead = exchange(service.url, ['GET / HTTP/1.1\r\n', ...Array.from({ length: 200 }, (_, i) => `X-${i}: y\r\n`)], { pause: 100 });
    const slowBody = exchange(service.url, [`POST /v1/edits HTTP/1.1\r\nHost: ${service.url.host}\r\nContent-Type: application/json\r\nContent-Length: 1000\r\n\r\n`, ...'x'.repeat(4)],
      { pause: 200 });
    await closed(silent);
    for (const { status, closed: ended } of [await slowHead, await slowBody]) assert.ok(status === 408 || (status === 0 && ended), `${status}`);
    await unharmed();
  });

  test('hundreds of connections that say nothing do not lock others out', async () => {
    const sockets = await Promise.all(Array.from({ length: 300 }, () => open().catch(() => null)));
    const start = Date.now();
    const other = new Client(service.url);
    for (;;) {  // one may be told that there is no room just now, and to come again
      const { status } = await other.get('/healthz', { timeout: 20_000, expect: [200, 503] }).catch((error) => {
        if (error instanceof assert.AssertionError) throw error;
        return { status: 0 };
      });
      assert.ok(Date.now() - start < 5_000, `not heard for ${Date.now() - start} ms`);
      if (status === 200) break;
      await sleep(200);
    }
    other.close();
    for (const socket of sockets) socket?.destroy();
    await unharmed();
  });

  test('two hundred heads that drip keep nobody waiting', async () => {
    const sockets = await Promise.all(Array.from({ length: 200 }, () => open()));
    let ended = 0;
    for (const socket of sockets) {
      socket.on('error', () => {});
      socket.on('close', () => ++ended);
      socket.write('GET /v1/scenes HTTP/1.1\r\nX: ');
    }
    const drip = setInterval(() => sockets.forEach((socket) => socket.write('x')), 20);
    for (let i = 0; i < 10; ++i)
      for (const target of ['/healthz', '/readyz', '/v1/scenes', `/v1/scenes/${scene.id}/versions/0/render?view=view_00.png&max_side=64`]) await client.get(target);
    assert.equal(ended, 0, 'they drip still');
    clearInterval(drip);
    for (const socket of sockets) socket.destroy();
    await unharmed();
  });

  test('pictures asked for and not waited for, again and again', async () => {
    const target = `/v1/scenes/${scene.id}/versions/0/render?eye=0,-1,-4&target=0,0,0&width=${limits.side}&height=${limits.side}`;
    for (let i = 0; i < 30; ++i) {
      const socket = await open();
      socket.on('error', () => {});
      socket.write(`GET ${target}&fov=${30 + i} HTTP/1.1\r\nHost: ${service.url.host}\r\n\r\n`);
      await sleep(5);
      if (i % 2) socket.resetAndDestroy?.() ?? socket.destroy();
      else socket.destroy();
    }
    await unharmed();
  });

  test('more edits than the queue takes are refused for now, and none of those accepted is lost', async () => {
    const large = await demoScene({ gaussians: 20_000, views: 24, size: '800x600', photos: false });
    const own = await client.upload(large.ply.subarray(0, large.ply.length), { name: 'queue' });
    await client.putDataset(own.id, await datasetZip(large.folder));
    const accepted = [];
    let busy;
    for (let i = 0; i < limits.queue + 5 && !busy; ++i) {
      const response = await client.request('POST', '/v1/edits', { json: { scene: own.id, ...large.leaf, params: { intervals: 20, max_image_side: 800, seed: i } }, expect: [202, 429] });
      if (response.status === 202) accepted.push(response.json().id);
      else busy = response;
    }
    assert.equal(busy?.json().code, 'busy');
    assert.match(busy.headers['retry-after'], /^\d+$/);
    assert.ok(accepted.length >= limits.queue);
    const streams = [client.events(accepted[0]), client.events(accepted[0])];
    await sleep(100);
    const third = await client.get(`/v1/edits/${accepted[0]}/events`, { expect: 429 });
    assert.match(third.headers['retry-after'], /^\d+$/);
    for (const id of accepted) await client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
    for (const id of accepted) assert.equal((await client.ended(id)).state, 'cancelled');
    await Promise.all(streams);
    for (const id of accepted) await client.delete(`/v1/edits/${id}`);
    await client.delete(`/v1/scenes/${own.id}`);
    await unharmed();
  });

  test('a reader of events that hangs up makes room for another', async () => {
    const events = `GET /v1/edits/${edit.id}/events HTTP/1.1\r\nHost: ${service.url.host}\r\n\r\n`;
    for (let i = 0; i < 3 * limits.streams; ++i) {
      const socket = await open();
      socket.on('error', () => {});
      socket.write(events);
      await sleep(20);
      socket.destroy();
    }
    await sleep(200);
    assert.equal((await client.events(edit.id)).length, 1);
    await unharmed();
  });
});

describe('a service with a token', () => {
  const token = 'correct-horse-battery-staple-0123456789';
  let guarded;
  before(async () => {
    const file = path.join(temporaryFolder(), 'token');
    await writeFile(file, `${token}\n`, { mode: 0o600 });
    guarded = await Service.start({ args: ['--token-file', file], token });
  });
  after(() => guarded?.stop());

  test('lets nobody in without it, except to health, the page and the session', async () => {
    const stranger = new Client(guarded.url);
    const open = ['/healthz', '/readyz', '/'];
    for (const { method, path: template, id } of operations) {
      if (open.includes(template)) {
        assert.equal((await stranger.request(method, template)).status, 200, template);
        continue;
      }
      const real = template.replace('{id}', 's000001').replace('{v}', '0').replace('{u}', '1').replace('{k}', '0');
      for (const authorization of [undefined, 'Bearer wrong', `Bearer ${token}x`, `Bearer ${token.slice(0, -1)}`, 'Bearer', `Basic ${Buffer.from(`x:${token}`).toString('base64')}`, token]) {
        const response = await stranger.request(method, real, { headers: authorization ? { authorization } : {} });
        if (id === 'endSession' && response.status === 204) continue;  // giving back a cookie needs no right
        assert.equal(response.status, 401, `${method} ${real} with ${authorization}`);
        assert.match(response.headers['www-authenticate'], /^Bearer/);
        await guarded.client.get('/v1/info');  // so that these do not count as guesses in a row
      }
    }
    stranger.close();
    assert.equal((await guarded.client.get('/v1/info')).json().token_required, true);
  });

  test('swaps it for a cookie that a page can use, and a foreign page cannot', async () => {
    const page = new Client(guarded.url);
    const { headers } = await guarded.client.request('POST', '/v1/session', { expect: 204 });
    const [set] = headers['set-cookie'];
    assert.match(set, /^splatdrag_session=[^;]+;.*HttpOnly/i);
    assert.match(set, /SameSite=Strict/i);
    assert.match(set, /Path=\//i);
    assert.ok(!set.includes(token));
    const cookie = set.split(';')[0];
    assert.equal((await page.get('/v1/info', { headers: { cookie } })).json().session, true);
    await page.get('/v1/info', { headers: { cookie: `a=b; ${cookie}; c=d` } });
    await page.request('POST', '/v1/edits', { headers: { cookie, origin: 'http://evil.example' }, json: {}, expect: 403 });
    for (const wrong of ['splatdrag_session=', 'splatdrag_session=x', `${cookie}x`, cookie.slice(0, -1), `x${cookie}`]) await page.get('/v1/info', { headers: { cookie: wrong }, expect: 401 });
    await page.request('DELETE', '/v1/session', { headers: { cookie }, expect: 204 });
    await page.get('/v1/info', { headers: { cookie }, expect: 401 });
    page.close();
  });

  test('slows down who guesses, and lets in who waits', async () => {
    const guesser = new Client(guarded.url);
    const guess = async (n) => guesser.request('GET', '/v1/info', { headers: { authorization: `Bearer ${token}${n}` } });
    for (let n = 0; n < 6; ++n) assert.equal((await guess(n)).status, 401, `guess ${n}`);
    const refused = await guess(6);
    assert.equal(refused.status, 429);
    const seconds = Number(refused.headers['retry-after']);
    assert.ok(seconds >= 1 && seconds <= 2, `${seconds}`);
    assert.equal((await guesser.request('GET', '/healthz')).status, 200);
    await new Promise((resolve) => { setTimeout(resolve, 1000 * seconds + 100); });
    await guarded.client.get('/v1/info');
    assert.equal((await guess(7)).status, 401, 'and all is forgotten');
    guesser.close();
  });
});

test('the log of all this names no crash', () => {
  assert.doesNotMatch(service.log, /AddressSanitizer|runtime error|terminate called|unhandled/i);
});
