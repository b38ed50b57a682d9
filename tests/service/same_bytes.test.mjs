// The same request gives the same bytes, today and tomorrow: edits of every kind against the hashes in
// same_bytes.json. It is there for changes that must not change a result. One that is meant to rewrites the table,
// with the program that is right:
//
//   SPLATDRAG_PROGRAM=build/release/splatdrag SPLATDRAG_REWRITE_BYTES=1 node --test tests/service/same_bytes.test.mjs
//
// Bytes are promised for one instruction set: it is pinned to one that every x86-64 machine of the last ten years has.
// The C library chooses among its functions by the machine, too, and those with fused multiply-adds round the last bit
// differently: it is told to leave them. Another C library or compiler may need another table.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { cp, mkdir, readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { summary } from './support/contract.mjs';
import { editRequests, farAway } from './support/edit_requests.mjs';
import { environment, run, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip } from './support/scenes.mjs';
import { asCapture, moveCameras, moved } from './support/variants.mjs';

environment.GLIBC_TUNABLES = 'glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2';
const simd = 'AVX2';
const here = /Here: ([^(]*)/.exec((await run('edit', '--help')).stdout)[1].trim().split(/,\s*/);
const skip = here.includes(simd) ? false : `SKIPPED: this machine lacks ${simd}, for which the table is; it has ${here.join(', ')}`;
if (skip) console.log(skip);

const tableFile = fileURLToPath(new URL('same_bytes.json', import.meta.url));
const rewriting = Boolean(process.env.SPLATDRAG_REWRITE_BYTES);
const table = rewriting ? {} : JSON.parse(await readFile(tableFile, 'utf8'));
const used = new Set();

const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');
const short = (value) => sha256(JSON.stringify(value)).slice(0, 16);

/// Fails with what differs, part by part.
const expectSame = (name, parts) => {
  used.add(name);
  if (rewriting) table[name] ??= parts;
  const expected = table[name];
  assert.ok(expected, `${name}: not in the table, which SPLATDRAG_REWRITE_BYTES=1 makes anew`);
  const different = Object.keys(parts).filter((part) => JSON.stringify(parts[part]) !== JSON.stringify(expected[part]))
    .map((part) => `  ${part}: ${JSON.stringify(parts[part])}, was ${JSON.stringify(expected[part])}`);
  assert.equal(different.length, 0, `${name}: not the same as before\n${different.join('\n')}`);
};

/// What a report tells, without the machine and the times.
const partsOfReport = (scene, { request, gaussians, handles, views, losses, pictures, warnings }) => ({
  scene: sha256(scene), gaussians, handles: short(handles), losses: short(losses), warnings: short(warnings), views: short(views),
  request: short(request), pictures: short(pictures) });
/// The same of an edit of the service, as far as it tells it.
const partsOfEdit = (scene, { gaussians, handles, finished_intervals: finished, warnings }) => ({
  scene: sha256(scene), gaussians,
  handles: short(handles.map((handle, i) => ({ gaussians: handle.gaussians, positions: finished.map(({ positions }) => positions[i]) }))),
  losses: short(finished.map(({ loss }) => loss).filter((loss) => loss !== null)), warnings: short(warnings) });

const folder = temporaryFolder();
await run('demo-scene', '--out', path.join(folder, 'demo'), '--gaussians', 12_000, '--views', 10, '--size', '160x120', ...(skip ? [] : ['--simd', simd]));
const drag = async (name) => {
  const { mode, handles } = JSON.parse(await readFile(path.join(folder, 'demo', 'drags', `${name}.json`), 'utf8'));
  return { mode, handles };
};
const requests = editRequests({ ball: await drag('ball'), leaf: await drag('leaf') });
const requestOf = (name) => requests.find((one) => one.name === name).request;
const sceneFile = (scene) => path.join(folder, scene, scene === 'splat' ? 'scene.splat' : 'scene.ply');

before(async () => {
  if (skip) return;
  const ply = await readFile(sceneFile('demo'));
  for (const other of ['capture', 'far', 'splat']) {
    await mkdir(path.join(folder, other));
    await cp(path.join(folder, 'demo', 'sparse'), path.join(folder, other, 'sparse'), { recursive: true });
  }
  await writeFile(sceneFile('capture'), asCapture(ply));
  await writeFile(sceneFile('far'), moved(ply, farAway));
  await moveCameras(path.join(folder, 'far'), farAway);
  await run('convert', '--in', sceneFile('demo'), '--out', sceneFile('splat'));
});

test('the scenes to edit are the same', { skip }, async () => {
  for (const scene of ['demo', 'capture', 'far', 'splat']) expectSame(`scene ${scene}`, { scene: sha256(await readFile(sceneFile(scene))) });
});

let edits = 0;
/// Carries a request out on the command line.
const edited = async ({ name, scene, dataset, request, pictures = 0, requestName }, threads) => {
  const out = path.join(folder, `edit${++edits}`);
  await mkdir(out);
  await writeFile(path.join(out, 'request.json'), JSON.stringify(request));
  await run('edit', '--scene', sceneFile(scene), ...(dataset ? ['--dataset', path.join(folder, scene)] : []), '--request', path.join(out, 'request.json'),
    ...(requestName ? ['--name', requestName] : []), '--out', out, '--pictures', pictures, '--simd', simd, '--threads', threads);
  const report = JSON.parse(await readFile(path.join(out, 'report.json'), 'utf8'));
  assert.equal(report.simd, simd, name);
  return partsOfReport(await readFile(path.join(out, 'scene.ply')), report);
};
for (const one of requests)
  test(`on the command line: ${one.name}`, { skip }, async () => {
    for (const threads of [2, ...(one.threads ?? [])]) expectSame(one.name, await edited(one, threads));
  });

let service, client, scene;
test('a service starts', { skip }, async () => {
  service = await Service.start({ args: ['--simd', simd, '--threads', 2] });
  client = service.client;
  scene = (await client.upload(await readFile(sceneFile('demo')), { name: 'demo' })).id;
  await client.putDataset(scene, await datasetZip(path.join(folder, 'demo')));
});
after(async () => {
  await service?.stop();
  if (!skip) console.log(summary());
});
const partsOf = async (edit) => partsOfEdit(await client.file(scene, edit.result_version), edit);

test('over REST: as on the command line', { skip }, async () => {
  for (const name of ['preset preview', 'preset standard', 'several handles, paper', 'extend, standard', 'a prompt', 'a zero drag']) {
    const { id } = await client.submit({ scene, version: 0, ...requestOf(name) });
    expectSame(name, await partsOf(await client.succeeded(id)));
  }
});

test('over REST: previews', { skip }, async () => {
  for (const name of ['preset preview', 'several handles, paper', 'extend, preview', 'groups and an anchor', 'a region', 'interpolation smooth']) {
    const preview = (await client.post('/v1/previews', { scene, version: 0, ...requestOf(name) })).json();
    const file = (await client.get(preview.links.file)).body;
    expectSame(`preview of ${name}`, { scene: sha256(file), gaussians: preview.gaussians, intervals: preview.intervals, handles: short(preview.handles), warnings: short(preview.warnings) });
  }
});

test('over REST: an edit of an edit', { skip }, async () => {
  const first = await client.succeeded((await client.submit({ scene, version: 0, ...requestOf('preset draft') })).id);
  const { id } = await client.submit({ scene, version: first.result_version, ...requestOf('several handles, standard') });
  expectSame('an edit of an edit', await partsOf(await client.succeeded(id)));
});

const long = requestOf('many intervals, corrected');
/// Stops the long edit when so many intervals are finished: {kept, parts}. The one in work is given up, but may be
/// finished before the order comes.
const stoppedAfter = async (interval) => {
  const { id } = await client.submit({ scene, version: 0, ...long });
  await client.until(id, (edit) => edit.finished_intervals.length >= interval, { every: 5 });
  await client.request('POST', `/v1/edits/${id}/stop`, { expect: [200, 409] });
  const edit = await client.succeeded(id);
  return { kept: edit.finished_intervals.length, parts: await partsOf(edit) };
};
const nameOfStopped = (kept) => kept === long.params.intervals ? 'many intervals, corrected' : `many intervals, stopped after ${kept} of ${long.params.intervals}`;

test('over REST: an edit stopped early', { skip }, async () => {
  const stop = async (interval) => {
    const { kept, parts } = await stoppedAfter(interval);
    assert.ok(kept >= interval);
    expectSame(nameOfStopped(kept), parts);
    return kept < long.params.intervals;
  };
  let stoppedEarly = 0;
  for (let interval = 1; interval < long.params.intervals; ++interval) {
    stoppedEarly += await stop(interval);
    // How many are kept is for the machine to say; a new table needs each.
    for (let tries = 0; rewriting && !table[nameOfStopped(interval)] && tries < 20; ++tries) await stop(interval);
    used.add(nameOfStopped(interval));
  }
  assert.ok(stoppedEarly > 0, 'no order came before the end');
});

test('over REST: an edit killed twice and resumed with other numbers of threads', { skip }, async () => {
  const { id } = await client.submit({ scene, version: 0, ...long });
  for (const [interval, threads] of [[1, 3], [2, 1]]) {
    await client.until(id, (edit) => edit.interval >= interval && edit.stage === 'optimise', { every: 5 });
    await service.kill();
    service.args = ['--simd', simd, '--threads', threads];
    await service.start();
    client = service.client;
  }
  expectSame(nameOfStopped(long.params.intervals), await partsOf(await client.succeeded(id)));
});

test('the table holds these and no others', { skip }, async () => {
  if (rewriting) await writeFile(tableFile, `{\n${Object.entries(table).map(([name, parts]) => `  ${JSON.stringify(name)}: ${JSON.stringify(parts)}`).join(',\n')}\n}\n`);
  else assert.deepEqual(Object.keys(table).filter((name) => !used.has(name)), []);
});
