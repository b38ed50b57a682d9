// The corrector `sd` and the loss `lpips` over HTTP, by the tiny checkpoint of the reference vectors: fine-tuned, annealed, killed, stopped,
// cancelled. Its weights are random, so nothing is said of what it paints.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { chmod, copyFile, cp, mkdir, readFile, symlink, truncate, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { launch } from './support/browser.mjs';
import { summary } from './support/contract.mjs';
import { openDesk, violations } from './support/desk.mjs';
import { environment, root, run, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

// Bytes are promised for a fixed number of libtorch's threads; on networks this small a second one only waits for the first.
environment.OMP_NUM_THREADS = '1';

const golden = process.env.SPLATDRAG_GOLDEN ?? path.join(root, '../shared/golden');
const models = temporaryFolder();

/// VGG16 in its own size, of a few numbers over and over: where values do not matter. As safetensors.
const vgg16 = () => {
  const widths = [[0, 3, 64], [2, 64, 64], [5, 64, 128], [7, 128, 128], [10, 128, 256], [12, 256, 256], [14, 256, 256], [17, 256, 512],
    [19, 512, 512], [21, 512, 512], [24, 512, 512], [26, 512, 512], [28, 512, 512]];
  const tensors = widths.flatMap(([place, from, to]) => [
    { name: `features.${place}.weight`, shape: [to, from, 3, 3], scale: Math.sqrt(6 / (9 * from)) }, { name: `features.${place}.bias`, shape: [to], scale: 0.05 }]);
  const header = {};
  let offset = 0;
  for (const { name, shape } of tensors) {
    const bytes = 4 * shape.reduce((product, size) => product * size, 1);
    header[name] = { dtype: 'F32', shape, data_offsets: [offset, offset += bytes] };
  }
  const text = JSON.stringify(header).padEnd(Math.ceil(JSON.stringify(header).length / 8) * 8);
  const file = Buffer.alloc(8 + text.length + offset);
  file.writeBigUInt64LE(BigInt(text.length));
  file.write(text, 8);
  const numbers = new Float32Array(file.buffer, file.byteOffset + 8 + text.length, offset / 4);
  let at = 0, state = 1;
  const few = Float32Array.from({ length: 1021 }, () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 31 - 1);
  for (const { shape, scale } of tensors) {
    const count = shape.reduce((product, size) => product * size, 1);
    for (let i = 0; i < count; ++i) numbers[at + i] = scale * few[i % few.length];
    at += count;
  }
  return file;
};

const bare = await Service.start();
const info = (await bare.client.get('/v1/info')).json();
const reasonOf = (list, name) => list.find((part) => part.name === name).reason;
const skip = reasonOf(info.correctors, 'sd').includes('libtorch') ? `SKIPPED: ${reasonOf(info.correctors, 'sd')}`
  : existsSync(golden) ? false : `SKIPPED: ${golden} is absent: the shared data is not on this machine`;
if (skip) console.log(skip);

let service, scene, request;
before(async () => {
  const demo = await demoScene({ gaussians: 4000, views: 5, size: '96x72', photos: false });
  const bareScene = await bare.client.upload(demo.ply);
  // Extended, for where something leaves its place, that is closed in space before anything is painted, which tells nothing of networks.
  // One edit moves.
  request = { scene: bareScene.id, ...demo.ball, mode: 'extend', prompt: 'a ball on a table',
    params: { corrector: 'sd', intervals: 2, annealing_steps: 2, iterations: 3, views: 2, max_image_side: 64, tuning_steps: 3, tuning_steps_later: 3,
      sampling_steps: 8, lora_rank: 2 } };
  if (skip) return;
  await symlink(path.join(golden, 'tiny_sd'), path.join(models, 'stable-diffusion'));
  await mkdir(path.join(models, 'lora'));
  await copyFile(path.join(golden, 'lora/diffusers_current.safetensors'), path.join(models, 'lora/few.safetensors'));
  await mkdir(path.join(models, 'lpips'));
  await writeFile(path.join(models, 'lpips/vgg16.safetensors'), vgg16());
  await copyFile(path.join(golden, 'lpips_lin/vgg_v0.1.safetensors'), path.join(models, 'lpips/vgg_v0.1.safetensors'));
  service = await Service.start({ args: ['--model-dir', models, '--threads', 1, '--edit-attempts', 1000, '--edit-time', '1000d', '--edit-memory', '64GiB'] });
  scene = await service.client.upload(demo.ply, { name: 'repainted' });
  await service.client.putDataset(scene.id, await datasetZip(demo.folder));
});
after(async () => {
  console.log(summary());
  await service?.stop();
  await bare.stop();
});

const submit = async (params = {}, more = {}) =>
  (await service.client.submit({ ...request, scene: scene.id, ...more, params: { ...request.params, ...params } })).id;
/// Networks compute with the machine's leftovers, as all edits do: beside other work an edit may take minutes.
const patient = { timeout: 600_000 };
const succeeded = (id) => service.client.succeeded(id, patient);
const until = (id, reached) => service.client.until(id, reached, { every: 5, ...patient });
const bytesOf = async (edit) => service.client.file(scene.id, edit.result_version);
let truth;  // the bytes of `request`, undisturbed
const undisturbed = async () => truth ??= await bytesOf(await succeeded(await submit()));
const again = async () => {
  await service.kill();
  await service.start();
};

test('without models, sd and lpips are refused with what it takes, and nothing else is', async () => {
  for (const [name, list, params] of [['sd', info.correctors, { corrector: 'sd' }], ['lpips', info.perceptual, { perceptual: 'lpips' }]]) {
    const part = list.find((one) => one.name === name);
    assert.equal(part.available, false);
    assert.match(part.reason, /--model-dir|libtorch-dev/);
    const refused = await bare.client.request('POST', '/v1/edits', { json: { ...request, params: { iterations: 1, ...params } }, expect: [422, 501] });
    assert.ok(refused.json().detail.includes(part.reason), refused.json().detail);
    assert.match(refused.json().where, /^params\.(corrector|perceptual)$/);
  }
  const parameters = info.parameters.filter(({ part }) => part === 'diffusion').map(({ name }) => name);
  assert.deepEqual(parameters, ['guidance', 'sampler', 'sampling_steps', 'lora_rank', 'tuning_steps', 'tuning_steps_later']);
});

test('models are listed with what is missing and where it goes', { skip }, async () => {
  const { stdout } = await run('models', '--model-dir', models);
  assert.match(stdout, /^sd: ready, .*\nlpips: ready, /);
  const damaged = temporaryFolder();
  await cp(path.join(models, 'lpips'), path.join(damaged, 'lpips'), { recursive: true });
  await truncate(path.join(damaged, 'lpips/vgg16.safetensors'), 1_000_000);
  await assert.rejects(run('models', '--model-dir', damaged), ({ stdout: text }) => /lpips: .*vgg16\.safetensors:/.test(text));
  const empty = temporaryFolder();
  await assert.rejects(run('models', '--model-dir', empty), ({ stdout: text }) => text.includes(path.join(empty, 'stable-diffusion')) && text.includes('vgg16.safetensors'));
  const { correctors, perceptual, loras } = (await service.client.get('/v1/info')).json();
  assert.deepEqual(loras, ['few']);
  assert.match(stdout, /\nlora few: ready, /);
  for (const [list, name] of [[correctors, 'sd'], [perceptual, 'lpips']]) assert.deepEqual(list.find((part) => part.name === name), { name, available: true, reason: null });
});

test('an edit learns, repaints by falling strength and learns again from what it made', { skip }, async () => {
  const id = await submit();
  const edit = await succeeded(id);
  const stages = new Set(edit.timings.map(({ stage }) => stage)); // A stage may be over before anybody hears of it.
  for (const stage of ['tune', 'repaint']) assert.ok(stages.has(stage), `${stage} is not among ${[...stages]}`);
  assert.equal(edit.finished_intervals.length, 2);
  assert.equal(edit.request.prompt, 'a ball on a table');
  assert.equal(edit.request.params.sampler, 'dpmpp2m');
  assert.equal(edit.request.params.tuning_steps, 3);
  assert.deepEqual(edit.warnings.filter((warning) => warning.includes('without effect')), []);
  for (const { renders } of edit.finished_intervals) assert.ok(renders[0].stages.corrected);
  truth = await bytesOf(edit);
});

test('the same request gives the same bytes, and prompt, seed and training make a difference', { skip }, async () => {
  const short = { intervals: 1, annealing_steps: 1, tuning_steps: 2 };
  const made = async (params, more) => bytesOf(await succeeded(await submit({ ...short, ...params }, more)));
  const expected = await made();
  assert.deepEqual(await made(), expected);
  for (const [what, params, more] of [['seed', { seed: 1 }], ['training', { tuning_steps: 0 }], ['rank', { lora_rank: 1 }], ['prompt', {}, { prompt: 'a hat' }],
    ['negative prompt', {}, { negative_prompt: 'a hat' }], ['guidance', { guidance: 1 }], ['sampler', { sampler: 'ddim' }], ['adapter', {}, { lora: 'few' }], ['corrector', { corrector: 'scene' }]])
    assert.notDeepEqual(await made(params, more), expected, what);
  const { request: kept } = await succeeded(await submit({ ...short, intervals: 1 }, { lora: 'few' }));
  assert.equal(kept.lora, 'few');
  const moved = await made({}, { mode: 'move' }); // what it has left is closed in space, and seeded
  assert.deepEqual(await made({}, { mode: 'move' }), moved);
});

test('an adapter that is not there is refused with those that are', { skip }, async () => {
  const asked = { ...request, scene: scene.id, lora: '../few' };
  const refused = await service.client.request('POST', '/v1/edits', { json: asked, expect: 422 });
  assert.equal(refused.json().where, 'lora');
  assert.match(refused.json().detail, /no adapter "..\/few" .*available: "few"; "splatdrag models"/);
  const idle = { ...asked, params: { ...request.params, corrector: 'scene' } };
  const none = await service.client.post('/v1/edits', { ...asked, lora: '' }, { query: { validate_only: true } });
  assert.equal(none.status, 200);
  const { warnings } = (await service.client.post('/v1/edits', idle, { query: { validate_only: true } })).json();
  assert.ok(warnings.some((warning) => /without effect.* lora/.test(warning)), warnings);
});

test('the page offers the adapters that are there, and asks with the one that is chosen', { skip }, async () => {
  const browser = await launch();
  try {
    const { page, id, complaints } = await openDesk({ room: { browser }, service, scene: scene.id });
    const exported = async () => {
      const [download] = await Promise.all([page.waitForEvent('download'), id('export').click()]);
      return JSON.parse(await readFile(await download.path(), 'utf8'));
    };
    const { params, ...wish } = request;
    const file = JSON.stringify({ ...wish, scene: undefined, lora: 'gone', params: { ...params, corrector: 'scene' } });
    await id('import-file').setInputFiles({ name: 'wish.json', mimeType: 'application/json', buffer: Buffer.from(file) });
    await id('settings').locator('summary').click();
    await id('other-params').getByText('adapter “gone”').waitFor();
    await id('param-corrector').selectOption('sd');
    assert.deepEqual(await id('lora').locator('option').allTextContents(), ['none', 'few', 'gone']);
    assert.equal(await id('lora').inputValue(), 'gone');
    await id('estimate').click();
    await id('run-problem').getByText('available: "few"').waitFor();
    await id('lora').selectOption('few');
    await id('run-problem').waitFor({ state: 'hidden' });
    assert.equal((await exported()).lora, 'few');
    await id('estimate').click();
    await id('estimate-answer').waitFor();
    await page.keyboard.press('Control+z');
    assert.equal(await id('lora').inputValue(), 'gone');
    await id('lora').selectOption('');
    assert.equal((await exported()).lora, undefined);
    assert.deepEqual(await violations(page), []);
    assert.deepEqual(complaints.filter((text) => !text.includes('422') && !text.includes('501')), []);
    await page.context().close();
  } finally {
    await browser.close();
  }
});

test('killed while it learns and while it paints, an edit ends with the same bytes', { skip }, async () => {
  const expected = await undisturbed();
  const id = await submit();
  // Where it is when it is killed is for the machine to say: at this place, or past it.
  const order = ['tune', 'repaint'];
  let kills = 0;
  for (const [interval, stage] of [[1, 'tune'], [1, 'repaint'], [2, 'tune'], [2, 'repaint']]) {
    const edit = await until(id, (edit) => edit.ended !== null || edit.interval > interval
      || (edit.interval === interval && order.indexOf(edit.stage) >= order.indexOf(stage)));
    if (edit.ended !== null) break;
    await again();
    kills += 1;
  }
  assert.ok(kills > 0, 'it ended before anybody could look');
  assert.deepEqual(await bytesOf(await succeeded(id)), expected);
});

test('killed, and the files of a model changed, an edit says so and does not go on', { skip }, async () => {
  // Copies: what is shared is not to be written to.
  const own = temporaryFolder();
  await cp(path.join(golden, 'tiny_sd'), path.join(own, 'stable-diffusion'), { recursive: true });
  for (const folder of ['lpips', 'lora']) await cp(path.join(models, folder), path.join(own, folder), { recursive: true });
  const writable = async (file) => {
    for (const name of [path.dirname(file), file]) await chmod(path.join(own, name), 0o755);
    return path.join(own, file);
  };
  const changed = await Service.start({ args: ['--model-dir', own, '--threads', 1, '--edit-time', '1000d', '--edit-memory', '64GiB'] });
  try {
    const { id: there } = await changed.client.upload((await demoScene({ gaussians: 4000, views: 5, size: '96x72', photos: false })).ply);
    // Without training, too: a repainter that has learned nothing still goes by its files.
    const long = { ...request.params, intervals: 3, iterations: 3, sampling_steps: 200, tuning_steps: 0, tuning_steps_later: 0, perceptual: 'lpips', max_image_side: 32 };
    for (const file of ['stable-diffusion/unet/diffusion_pytorch_model.safetensors', 'lpips/vgg_v0.1.safetensors', 'lora/few.safetensors']) {
      const { id } = await changed.client.submit({ ...request, scene: there, lora: 'few', params: long });
      await changed.client.until(id, (edit) => edit.ended !== null || edit.finished_intervals.length > 0, { every: 5, ...patient });
      await changed.kill();
      const place = await writable(file);
      const bytes = await readFile(place);
      bytes[bytes.length - 4] ^= 1; // the least place of a number
      await writeFile(place, bytes);
      await changed.start();
      const edit = await changed.client.ended(id, patient);
      assert.equal(edit.state, 'failed', file);
      assert.equal(edit.error.where, 'checkpoint');
      assert.match(edit.error.detail, /files of the .* have changed since the edit began/);
    }
  } finally {
    await changed.stop();
  }
});

test('cancelled while it learns or paints, an edit ends at once; stopped, with the interval before', { skip }, async () => {
  // So long that no stage ends by itself while the test looks.
  const long = { tuning_steps: 20_000, tuning_steps_later: 20_000, sampling_steps: 500, strength_initial: 1, strength_final: 1 };
  for (const [params, stage] of [[long, 'tune'], [{ ...long, tuning_steps: 1 }, 'repaint']]) {
    const id = await submit(params, { allow_slow: true });
    await until(id, (edit) => edit.stage === stage);
    await service.client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
    assert.equal((await service.client.ended(id, patient)).state, 'cancelled', stage);
  }
  const id = await submit({ tuning_steps: 2, tuning_steps_later: 20_000, annealing_steps: 1 }, { allow_slow: true });
  await until(id, (edit) => edit.interval === 2 && edit.stage === 'tune');
  await service.client.request('POST', `/v1/edits/${id}/stop`, { expect: 200 });
  const edit = await succeeded(id);
  assert.equal(edit.stopped_early, true);
  assert.equal(edit.finished_intervals.length, 1);
});

test('what would take hours has to be allowed, and the estimate tells how long', { skip }, async () => {
  const slow = { ...request, scene: scene.id, params: { ...request.params, intervals: 20, tuning_steps: 100_000, tuning_steps_later: 100_000 } };
  const estimate = (await service.client.post('/v1/edits', slow, { query: { validate_only: true } })).json();
  assert.ok(estimate.estimate.seconds > 3600, `${estimate.estimate.seconds} s`);
  assert.ok(estimate.warnings.some((warning) => warning.includes('allow_slow')), estimate.warnings);
  const allowed = (await service.client.post('/v1/edits', { ...slow, allow_slow: true }, { query: { validate_only: true } })).json();
  assert.deepEqual(allowed.warnings.filter((warning) => warning.includes('allow_slow')), []);
  const refused = (await service.client.request('POST', '/v1/edits', { json: slow, expect: 422 })).json();
  assert.equal(refused.where, 'allow_slow');
  const { id } = await service.client.submit({ ...slow, allow_slow: true });
  await service.client.request('POST', `/v1/edits/${id}/cancel`, { expect: 200 });
  assert.equal((await service.client.ended(id, patient)).state, 'cancelled');
});

test('lpips judges the cases of a benchmark', { skip }, async () => {
  const out = temporaryFolder();
  const { stdout } = await run('bench-edit', '--case', 'speck', '--preset', 'preview', '--corrector', 'none', '--pictures', 0, '--model-dir', models, '--out', out);
  const [{ lpips, untouched_lpips }] = JSON.parse(await readFile(path.join(out, 'bench.json'))).cases;
  assert.ok(lpips > 0 && untouched_lpips > 2 * lpips, `${lpips}, before the edit ${untouched_lpips}`);
  assert.ok(stdout.includes(`| ${lpips.toFixed(4)} |`), stdout);
});

test('lpips is part of the estimate, and of what a refusal advises', { skip }, async () => {
  const estimate = async (params, expect = 200) => (await service.client.request('POST', '/v1/edits', {
    json: { ...request, scene: scene.id, params: { corrector: 'scene', iterations: 1000, views: 5, max_image_side: 96, ...params } }, query: { validate_only: true }, expect })).json();
  const [without, with_it] = [await estimate({}), await estimate({ perceptual: 'lpips' })];
  assert.ok(with_it.estimate.seconds > without.estimate.seconds + 10, `${with_it.estimate.seconds} s, without it ${without.estimate.seconds} s`);
  assert.ok(with_it.estimate.memory_bytes > without.estimate.memory_bytes + 60e6, `${with_it.estimate.memory_bytes}, without it ${without.estimate.memory_bytes}`);
  const small = await Service.start({ args: ['--model-dir', models, '--threads', 1, '--edit-memory', `${Math.round(without.estimate.memory_bytes / 2 ** 20) + 20}MiB`] });
  try {
    const { id } = await small.client.upload((await demoScene({ gaussians: 4000, views: 5, size: '96x72', photos: false })).ply);
    const refused = (await small.client.request('POST', '/v1/edits', { json: { ...request, scene: id, params: { corrector: 'scene', iterations: 1, views: 5, max_image_side: 96, perceptual: 'lpips' } }, expect: 413 })).json();
    assert.match(refused.detail, /set params.perceptual to "msssim"/);
  } finally {
    await small.stop();
  }
});

test('lpips compares what is optimised with what was painted', { skip }, async () => {
  const params = { intervals: 1, annealing_steps: 1, tuning_steps: 1, max_image_side: 48, iterations: 2 };
  const edit = await succeeded(await submit({ ...params, perceptual: 'lpips' }));
  assert.equal(edit.request.params.perceptual, 'lpips');
  assert.ok(edit.finished_intervals[0].loss > 0);
  const other = await succeeded(await submit(params));
  assert.notEqual(other.finished_intervals[0].loss, edit.finished_intervals[0].loss);
});
