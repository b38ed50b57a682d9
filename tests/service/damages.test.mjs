// A single bit that flips, or a file that ends early, anywhere in the data folder: it is named or harmless, nothing
// damaged is served, and nobody else's data is lost. By chance, in the order of a seed.
//
//     SPLATDRAG_TEST_DAMAGES=1000 node --test damages.test.mjs
//
// goes on for longer than CI has time for.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, readdirSync, readFileSync, rmSync, statSync, truncateSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { Service, program, temporaryFolder } from './support/program.mjs';
import { randomFrom } from './support/random.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const seed = Number(process.env.SPLATDRAG_TEST_SEED ?? 1);
const rounds = Number(process.env.SPLATDRAG_TEST_DAMAGES ?? 200);
/// A machine that is slow does fewer of them, but not fewer than these: unless more were asked for.
const [mostSeconds, leastRounds] = process.env.SPLATDRAG_TEST_DAMAGES ? [Infinity, rounds] : [60, 40];
const random = randomFrom(seed);

let demo, sound, files, truth, pending;
const counts = { named: 0, harmless: 0, rebuilt: 0 };

/// All files below a folder that hold something, but for locks: paths relative to it.
const filesBelow = (folder, below = '') => readdirSync(path.join(folder, below), { withFileTypes: true }).flatMap((item) => {
  const name = path.join(below, item.name);
  if (item.isDirectory()) return filesBelow(folder, name);
  return item.name !== '.lock' && statSync(path.join(folder, name)).size > 0 ? [name] : [];
}).sort();

/// What a client may get, by name, each with the scene or edit whose it is: [{owner, ask}].
const asked = (client) => {
  const all = {};
  for (const scene of ['s000001', 's000002']) {
    for (const version of [0, 1, 2])
      all[`${scene} version ${version}`] = { owner: scene, path: `/v1/scenes/${scene}/versions/${version}/file` };
    all[`${scene} views`] = { owner: scene, path: `/v1/scenes/${scene}/views` };
  }
  for (const edit of ['e000001', 'e000002', 'e000003', 'e000004']) {
    all[`${edit}`] = { owner: edit, path: `/v1/edits/${edit}`,
      read: ({ body }) => { const { state, scene, result_version } = JSON.parse(body); return `${state} ${scene} ${result_version}`; } };
    all[`${edit} picture`] = { owner: edit, path: `/v1/edits/${edit}/intervals/1/renders/0?stage=deformed` };
  }
  return Object.entries(all).map(([name, { owner, path: url, read = ({ body }) => body.toString('base64') }]) => ({
    name, owner, get: async () => {
      const answer = await client.request('GET', url);
      return answer.status === 200 ? { value: read(answer) } : { problem: answer.json() };
    } }));
};
const resultOf = async (client) => {
  const edit = await client.ended(pending);
  if (edit.state !== 'succeeded') return { problem: edit.error };
  return { value: (await client.file('s000002', edit.result_version)).toString('base64') };
};

before(async () => {
  demo = await demoScene({ gaussians: 2_000, views: 4, size: '160x120', photos: false });
  const service = await Service.start();
  const { client } = service;
  const zip = await datasetZip(demo.folder);
  for (const name of ['first', 'second']) {
    const { id } = await client.upload(demo.ply, { name });
    await client.putDataset(id, zip);
    for (const intervals of [1, 2])
      await client.succeeded((await client.submit({ scene: id, ...demo.leaf, params: { intervals, max_image_side: 64 } })).id);
  }
  truth = {};
  for (const { name, get } of asked(client)) truth[name] = await get();
  for (const [name, { problem }] of Object.entries(truth)) assert.ok(!problem, `${name}: ${JSON.stringify(problem)}`);
  // One that is cut in the middle, and goes on in each round.
  pending = (await client.submit({ scene: 's000002', ...demo.ball, params: { intervals: 6, max_image_side: 128 } })).id;
  await client.until(pending, (edit) => edit.finished_intervals.length >= 1, { every: 1 });
  await service.kill();
  sound = temporaryFolder();
  cpSync(service.dataDir, sound, { recursive: true });
  files = filesBelow(sound);
  await service.start();
  truth.pending = await resultOf(service.client);
  assert.ok(truth.pending.value);
  await service.stop();
});
after(async () => console.log(`seed ${seed}: ${JSON.stringify(counts)} in ${files?.length} files`));

const damage = (file) => {
  const size = statSync(file).size;
  if (random() < 0.25) {
    const left = random.below(size);
    truncateSync(file, left);
    return `cut to ${left} of ${size} bytes`;
  }
  const bytes = readFileSync(file), bit = random.below(8 * size);
  bytes[bit >> 3] ^= 1 << (bit & 7);
  writeFileSync(file, bytes);
  return `bit ${bit}`;
};

/// Whose data a file is: a scene's, an edit's, that of all edits, or nobody's.
const ownerOf = (file) => /^scenes\/(s\d+)\//.exec(file)?.[1] ?? /^edits\/jobs\/(e\d+)/.exec(file)?.[1] ?? (file.startsWith('edits/jobs.db') ? 'edits' : 'nobody');

test(`${rounds} damages, each named or harmless`, { timeout: 30 * 60_000 }, async () => {
  const began = Date.now();
  let round = 0;
  for (; round < rounds && (round < leastRounds || Date.now() - began < 1000 * mostSeconds); ++round) {
    const dataDir = temporaryFolder();
    cpSync(sound, dataDir, { recursive: true });
    const file = random.of(files), what = `round ${round}, ${file}, ${damage(path.join(dataDir, file))}`;
    const owner = ownerOf(file);
    let service, isNamed = false;
    try {
      execFileSync(program, ['admin', 'check', '--data', dataDir], { stdio: 'pipe' });
    } catch ({ status }) {
      assert.equal(status, 4, `${what}: admin check`);
      isNamed = true;
    }
    try {
      service = await Service.start({ dataDir, args: ['--log-level', 'warn'] });
    } catch (refused) {
      // The records of edits: the service says so, and how to have them made again.
      assert.equal(owner, 'edits', `${what}: ${refused.message}`);
      assert.match(refused.message, /jobs\.db/, what);
      execFileSync(program, ['admin', 'rebuild', '--data', dataDir], { stdio: 'pipe' });
      ++counts.rebuilt;
      isNamed = true;
      service = await Service.start({ dataDir, args: ['--log-level', 'warn'] });
    }
    const { client } = service;
    const namesIt = (problem) => problem.where?.includes(file) || problem.detail?.includes(file) || problem.message?.includes(file);
    const got = [...asked(client), { name: 'pending', owner: 's000002', get: () => resultOf(client) }];
    for (const { name, owner: whose, get } of got) {
      const { value, problem } = await get();
      if (!problem) {
        assert.equal(value, truth[name].value, `${what}: ${name} is served, but is not what it was`);
        continue;
      }
      assert.ok(whose === owner || (name === 'pending' && owner === pending), `${what}: ${name} is lost: ${JSON.stringify(problem)}`);
      const isInLog = service.log.includes(path.basename(file)) || service.log.includes(owner);
      assert.ok(namesIt(problem) || isInLog, `${what}: ${name}: ${JSON.stringify(problem)}\n${service.log}`);
      isNamed = true;
    }
    isNamed ||= service.log.includes(path.basename(file));
    await service.kill();
    rmSync(dataDir, { recursive: true });
    counts[isNamed ? 'named' : 'harmless'] += 1;
  }
  console.log(`${round} damages in ${Math.round((Date.now() - began) / 1000)} s`);
  assert.ok(counts.named >= round / 4, 'hardly one of them was noticed');
});
