// Uploads that are worth gigabytes to whoever believes them, sixteen at once, on a machine of 2 GiB, while an edit runs: each
// is refused or looked at when there is room, the service lives, and the edit's result is what it is in peace.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import { alikeSpz, blackPng, emptyFrames, hollowExr, manyElements, oneView } from './support/bombs.mjs';
import { summary } from './support/contract.mjs';
import { confined } from './support/confined.mjs';
import { finalStates } from './support/client.mjs';
import { Service } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';
import { zip } from './support/zip.mjs';

const gibibyte = 2 ** 30;
const limit = confined(2 * gibibyte);
let demo, service, client, scene, attacks;

before(async () => {
  demo = await demoScene({ gaussians: 10_000, views: 8, size: '320x240' });
  service = await Service.start({ within: limit.within });
  client = service.client;
  scene = await client.upload(demo.ply, { name: 'edited' });
  await client.putDataset(scene.id, await datasetZip(demo.folder));
  const photo = await blackPng(16384, 8192);
  const attacked = async (body) => {
    const { id } = await client.upload(demo.ply, { name: 'attacked' });
    return () => client.request('PUT', `/v1/scenes/${id}/dataset`, { body, headers: { 'content-type': 'application/zip' } });
  };
  const upload = async (body) => client.request('POST', '/v1/scenes', { body, headers: { 'content-type': 'application/octet-stream' } });
  const select = async (image) => client.request('POST', `/v1/scenes/${scene.id}/versions/0/select`,
    { json: { selection: [{ masks: [{ view: 'view_00.png', image: image.toString('base64') }] }] } });
  const large = oneView(16384, 8192, 'a.png', photo);
  const fitting = oneView(3072, 2048, 'a.png', await blackPng(3072, 2048));
  const frames = zip([{ name: 'transforms.json', bytes: emptyFrames(19_000_000) }]);
  const hollow = oneView(16384, 8192, 'a.exr', hollowExr(16384, 8192));
  const spz = await alikeSpz(50_000_000), ply = manyElements(60_000), exr = hollowExr(16384, 8192);
  attacks = [
    { name: 'a dataset with a large photo', send: await attacked(large), bytes: large.length, taken: true },
    { name: 'a dataset with a photo that fits, once at a time', send: await attacked(fitting), bytes: fitting.length, taken: true },
    { name: 'a transforms.json of empty frames', send: await attacked(frames), bytes: frames.length },
    { name: 'a dataset with a hollow EXR photo', send: await attacked(hollow), bytes: hollow.length, taken: true },
    { name: '50 million Gaussians', send: () => upload(spz), bytes: spz.length },
    { name: 'a header of 60,000 elements', send: () => upload(ply), bytes: ply.length },
    { name: 'a hollow EXR mask', send: () => select(exr), bytes: exr.length },
    { name: 'a large mask', send: () => select(photo), bytes: photo.length },
  ];
});
after(async () => {
  console.log(`${summary()}`);
  await service?.stop();
});

const resident = () => Number(/VmHWM:\s+(\d+)/.exec(readFileSync(`/proc/${service.process.pid}/status`, 'utf8'))[1]) * 1024;
const mib = (bytes) => `${Math.round(bytes / 2 ** 20)} MiB`;

test('sixteen hostile uploads at once leave the service alive, and a running edit its bytes', async () => {
  const request = { scene: scene.id, ...demo.leaf, preset: 'draft' };
  const inPeace = await client.succeeded((await client.submit(request)).id);
  const expected = await client.file(scene.id, inPeace.version);
  const before = resident();

  const { id } = await client.submit(request);
  await client.until(id, (edit) => edit.state === 'running');
  const seen = new Map(attacks.map(({ name }) => [name, new Map()]));
  let slowest = { seconds: 0 };
  let next = 0, beside = 0, isOver = false;
  const ended = async () => finalStates.includes((await client.edit(id)).state);
  const deadline = Date.now() + 10_000;
  const attacker = async () => {
    do {
      const { name, send, taken = false } = attacks[next++ % attacks.length];
      const start = Date.now();
      const { status, json } = await send().catch((error) => {
        const { exitCode, signalCode } = service.process;
        throw new Error(`${name}: ${error.message}; the service ended: ${exitCode ?? signalCode}\n${service.log.slice(-2000)}`);
      });
      const seconds = (Date.now() - start) / 1000;
      if (seconds > slowest.seconds) slowest = { name, seconds };
      const answer = json();
      // A dataset is taken with a photo that cannot be compared: then a warning says why.
      assert.ok([400, 413, 422, 429, 503].includes(status) || (taken && status === 200), `${name}: ${status} ${answer.detail}`);
      const told = status === 200 ? `200 ${answer.dataset.warnings[0] ?? ''}` : `${status} ${answer.code}`;
      seen.get(name).set(told, (seen.get(name).get(told) ?? 0) + 1);
      isOver = await ended();
      if (!isOver) ++beside;
    } while (Date.now() < deadline && (next < 2 * attacks.length || !isOver));
  };
  await Promise.all(Array.from({ length: 16 }, attacker));
  const edit = await client.succeeded(id);
  assert.deepEqual(await client.file(scene.id, edit.version), expected);
  await service.alive();
  assert.ok(beside > 0, 'the edit was over before a hostile request was answered');
  assert.doesNotMatch(service.log, /"bug|terminate called|bad_alloc/i);
  for (const { name, bytes } of attacks)
    console.log(`${name} (${bytes} bytes): ${[...seen.get(name)].map(([told, times]) => `${times} x ${told}`).join(', ')}`);
  console.log(`${next} hostile requests, 16 at once, ${beside} answered beside the edit, within ${limit.kind} of ${mib(2 * gibibyte)}; the slowest took ${slowest.seconds} s (${slowest.name}). ` +
    `Resident at most: ${mib(resident())}, ${mib(before)} before${Number.isNaN(limit.peak()) ? '' : `; the group's peak: ${mib(limit.peak())}`}`);
});
