// The page in a real browser, with a real mouse: from the upload to the download.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { loadBrowser } from './support/packages.mjs';
import { Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const browserProgram = process.env.SPLATDRAG_BROWSER ?? '/usr/bin/chromium';
assert.ok(existsSync(browserProgram), `There is no browser at ${browserProgram}: install Debian's chromium, or name one in SPLATDRAG_BROWSER.`);
const screenshot = process.env.SPLATDRAG_SCREENSHOT;
const patience = 30_000;

let browser, demo, zipFile;
before(async () => {
  const chromium = await loadBrowser();
  browser = await chromium.launch({
    executablePath: browserProgram,
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
  demo = await demoScene({ gaussians: 20_000, views: 24, size: '800x600', photos: false });
  zipFile = path.join(temporaryFolder(), 'demo.zip');
  await writeFile(zipFile, await datasetZip(demo.folder));
});
after(() => browser?.close());

/// A new page of a service that notes what a user would never see: errors in the console, requests to elsewhere.
const open = async (service, { viewport = { width: 1280, height: 800 } } = {}) => {
  const context = await browser.newContext({ viewport, acceptDownloads: true });
  const page = await context.newPage();
  page.setDefaultTimeout(patience);
  const complaints = [];
  page.on('console', (message) => {
    const expected = /status of 401/.test(message.text());  // asked before signing in
    if (message.type() === 'error' && !expected) complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (request) => {
    if (!request.url().startsWith(service.url.origin) && !/^(blob|data):/.test(request.url())) complaints.push(`went to ${request.url()}`);
  });
  await page.goto(service.url.href);
  return { page, complaints, id: (name) => page.getByTestId(name) };
};

describe('the page', () => {
  let service, client, page, id, complaints;
  before(async () => {
    service = await Service.start();
    client = service.client;
    ({ page, id, complaints } = await open(service));
  });
  after(async () => {
    await page?.context().close();
    await service?.stop();
  });

  /// Until the picture on the screen is the full one of a version.
  const shown = (version) => page.waitForFunction((wanted) => {
    const view = document.querySelector('[data-testid=view]');
    return view?.dataset.version === String(wanted) && view.dataset.quality === 'full';
  }, version, { timeout: patience });
  const only = async () => (await client.get('/v1/scenes')).json().scenes[0];
  const numbers = async (field) => Promise.all(['x', 'y', 'z'].map(async (axis) => Number(await id('handle-card-0').getByTestId(`${field}-${axis}`).inputValue())));

  test('uploads a scene and shows it', async () => {
    await id('home').waitFor();
    await id('scene-file').setInputFiles(path.join(demo.folder, 'scene.ply'));
    await id('workspace').waitFor();
    await shown(0);
    assert.equal((await only()).name, 'scene');
  });

  test('uploads a dataset, whose views can be looked from', async () => {
    await id('tab-button-scene').click();
    await id('dataset-file').setInputFiles(zipFile);
    await id('dataset').getByText('24 views').waitFor();
    await id('view-select').selectOption('view_12.png');
    await shown(0);
  });

  /// With the mouse: a handle on the ball that stands in the picture, and its target beside it.
  const placeAndDrag = async () => {
    const box = await id('view').boundingBox();
    await page.mouse.click(box.x + box.width * 0.4, box.y + box.height * 0.655);
    await id('handle-card-0').waitFor();
    await id('handle-count-0').getByText(/\d/).waitFor();
    const source = await numbers('source');
    const { x, y, width, height } = await id('handle-0-source').boundingBox();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width / 2 + 60, y + height / 2 - 50, { steps: 8 });
    await page.mouse.up();
    await id('handle-0-target').waitFor();
    return { source, target: await numbers('target') };
  };

  test('places a handle where the mouse clicks, and its target where the mouse drags it', async () => {
    await id('tab-button-drag').click();
    const { source, target } = await placeAndDrag();
    assert.deepEqual(await numbers('source'), source);
    assert.ok(Math.hypot(...target.map((value, axis) => value - source[axis])) > 0.05, `from ${source} to ${target}`);
  });

  test('previews the drag', async () => {
    await id('preview').click();
    await id('preview-answer').getByText('Preview of').waitFor();
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    await id('shown-chip').getByText('Preview').waitFor();
    if (screenshot) await page.screenshot({ path: screenshot });
  });

  test('runs the edit, shows its pictures as they come, and stops it to keep what there is', async () => {
    await id('settings').locator('summary').click();
    const offered = (testid) => id(testid).locator('option:not([disabled])').evaluateAll((options) => options.map(({ value }) => value));
    assert.deepEqual(await offered('preset'), ['', 'draft', 'standard', 'paper']);
    assert.deepEqual(await offered('param-corrector'), ['', 'none', 'scene'], 'what this build has');
    const { parameters } = (await client.get('/v1/info')).json();
    for (const { name, type } of parameters)
      assert.equal(await id(`param-${name.replaceAll('_', '-')}`).count(), type === 'array' ? 0 : 1, `a field for ${name}`);
    await id('preset').selectOption('draft');
    assert.equal(await id('param-views').getAttribute('placeholder'), '24', 'what the preset says');
    await id('param-corrector').selectOption('scene');
    await id('param-intervals').fill('20');
    await id('param-views').fill('4');
    await id('param-max-image-side').fill('160');
    await id('param-max-image-side').blur();
    await id('run').click();
    await id('tab-edits').waitFor();
    await page.waitForFunction(() => document.querySelector('[data-testid=thumb-1-0] img')?.naturalWidth > 0, null, { timeout: patience });
    await id('edit-stop').click();
    await page.locator('[data-testid^="edit-e"][data-state=succeeded]').waitFor();
    const [edit] = (await client.get('/v1/edits')).json().edits;
    assert.equal(edit.stopped_early, true);
    assert.ok(edit.finished_intervals.length < 20);
    assert.equal(edit.result_version, 1);
    assert.deepEqual([edit.request.preset, edit.request.params.corrector], ['draft', 'scene']);
    assert.ok(edit.finished_intervals[0].renders[0].stages.corrected);
  });

  test('shows the result, and downloads it', async () => {
    await shown(1);
    await id('tab-button-scene').click();
    const [download] = await Promise.all([page.waitForEvent('download'), id('download-1-ply').click()]);
    assert.match(download.suggestedFilename(), /\.ply$/);
    assert.deepEqual(await readFile(await download.path()), await client.file((await only()).id, 1));
  });

  test('is where it was after a reload', async () => {
    await id('tab-button-drag').click();
    const { source, target } = await placeAndDrag();
    await page.reload();
    await id('handle-head-0').click();
    assert.deepEqual({ source: await numbers('source'), target: await numbers('target') }, { source, target });
    await page.waitForFunction(() => document.querySelector('[data-testid=version-select]').value === '1');
  });

  test('says what the service refuses, at the handle it is about', async () => {
    await id('handle-card-0').getByTestId('source-x').fill('100');
    await id('handle-card-0').getByTestId('source-x').blur();
    await id('preview').click();
    await id('handle-problem-0').getByText(/nearest/).waitFor();
    await id('clear-handles').click();
  });

  test('goes back to the version before', async () => {
    await id('tab-button-scene').click();
    await id('undo-version').click();
    await shown(0);
  });

  test('raised no error that only the console shows, and asked nobody else', () => {
    assert.deepEqual(complaints.filter((text) => !/status of 422/.test(text)), [], 'but for the refusal that was asked for');
  });
});

describe('the page of a service with a token', () => {
  let service;
  const token = 'a-token-that-nobody-guesses';
  before(async () => {
    const file = path.join(temporaryFolder(), 'token');
    await writeFile(file, token, { mode: 0o600 });
    service = await Service.start({ args: ['--token-file', file], token });
  });
  after(() => service?.stop());

  test('asks for it once, refuses a wrong one, and shows pictures by its cookie', async () => {
    const scene = await service.client.upload(demo.ply, { name: 'secret' });
    const { page, id, complaints } = await open(service);
    await id('token').fill('wrong');
    await id('token-submit').click();
    await id('token-problem').getByText('token').waitFor();
    await id('token').fill(token);
    await id('token-submit').click();
    await id(`scene-${scene.id}`).getByTestId('scene-open').click();
    await page.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.quality === 'full');
    await page.reload();
    await page.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.quality === 'full');
    assert.equal(await id('sign-in').count(), 0);
    assert.deepEqual(complaints, []);
    await page.context().close();
  });
});
