// The page in a real browser, with a real mouse: from the upload to the download.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { launch, openPage, patience } from './support/browser.mjs';
import { Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene, fox } from './support/scenes.mjs';

const screenshot = process.env.SPLATDRAG_SCREENSHOT;

let browser, demo, zipFile;
before(async () => {
  browser = await launch();
  demo = await demoScene({ gaussians: 20_000, views: 24, size: '800x600', photos: false });
  zipFile = path.join(temporaryFolder(), 'demo.zip');
  await writeFile(zipFile, await datasetZip(demo.folder));
});
after(() => browser?.close());
const open = (service, options) => openPage(browser, service, options);

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
    await id('hand-handle').click();
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
    for (const { name, type, part } of parameters) {
      const field = type === 'array' || part === 'diffusion' ? 0 : 1; // No weights of a diffusion model are there.
      assert.equal(await id(`param-${name.replaceAll('_', '-')}`).count(), field, `a field for ${name}`);
    }
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

/// Selecting in an open page, as a person does; places are fractions of the picture.
const handOn = ({ page, id }) => {
  const at = async ([x, y]) => {
    const box = await id('view').boundingBox();
    return [box.x + box.width * x, box.y + box.height * y];
  };
  return {
    click: async (place, button = 'left') => page.mouse.click(...await at(place), { button }),
    drag: async (...places) => {
      await page.mouse.move(...await at(places[0]));
      await page.mouse.down();
      for (const place of places.slice(1)) await page.mouse.move(...await at(place), { steps: 6 });
      await page.mouse.up();
    },
    /// How many Gaussians the page says are selected, once it knows, and the picture shows them.
    count: async () => Number(await (await page.waitForFunction(() => {
      const { count, waits } = document.querySelector('[data-testid=selection-count]').dataset;
      const { selection, quality } = document.querySelector('[data-testid=view]').dataset;
      return count > 0 && waits === undefined && selection && quality === 'full' && count;
    })).jsonValue()),
    /// How far the colours around a place of the picture are from the tint.
    fromTint: ([x, y]) => page.getByTestId('picture').evaluate((canvas, [fx, fy]) => {
      const { data } = canvas.getContext('2d').getImageData(fx * canvas.width - 4, fy * canvas.height - 4, 9, 9);
      let sum = 0;
      for (let i = 0; i < data.length; i += 4) sum += Math.hypot(data[i] - 255, data[i + 1] - 26, data[i + 2] - 153);
      return sum / (data.length / 4);
    }, [x, y]),
    /// What the service is asked and answers when something is done that selects.
    answerTo: async (act) => {
      const [response] = await Promise.all([page.waitForResponse((r) => r.url().endsWith('/select')), act()]);
      return { answer: await response.json(), asked: response.request().postDataJSON().selection };
    },
  };
};

/// A service with one scene and its cameras, and the page that shows it.
const sceneOpen = async (ply, folder) => {
  const service = await Service.start();
  const scene = await service.client.upload(ply, { name: 'scene' });
  await service.client.putDataset(scene.id, await datasetZip(folder));
  const opened = await open(service);
  await opened.id(`scene-${scene.id}`).getByTestId('scene-open').click();
  await opened.page.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.quality === 'full');
  return { service, scene, ...opened, ...handOn(opened) };
};

describe('selecting', () => {
  // The mug of the demo scene: where it stands in the world, and in the picture of the first view.
  const mug = { centre: [1.3, -0.16, -0.42], size: 0.5, on: [[0.771, 0.628], [0.809, 0.691]], rim: [[0.75, 0.57], [0.81, 0.57]] };
  const wall = [0.4, 0.1];
  let desk;
  before(async () => {
    desk = await sceneOpen(demo.ply, demo.folder);
  });
  after(async () => {
    await desk?.page.context().close();
    await desk?.service.stop();
  });

  let whole;
  test('two clicks select the mug, and it is seen tinted', async () => {
    const { id, click, count, fromTint, answerTo } = desk;
    const before = { mug: await fromTint(mug.on[0]), wall: await fromTint(wall) };
    await id('hand-select').click();
    await answerTo(() => click(mug.on[0]));
    const { answer, asked } = await answerTo(() => click(mug.on[1]));
    assert.equal(asked.length, 1, 'both clicks are of one thing');
    assert.equal(asked[0].grow.inside.length, 2);
    for (let axis = 0; axis < 3; ++axis) {
      assert.ok(Math.abs(answer.centre[axis] - mug.centre[axis]) < mug.size / 2, `centre ${answer.centre}`);
      assert.ok(answer.bounds.high[axis] - answer.bounds.low[axis] < 2 * mug.size, `bounds ${JSON.stringify(answer.bounds)}`);
    }
    whole = await count();
    assert.equal(whole, answer.count);
    assert.ok(whole > 50, `${whole}`);
    assert.equal(await id('click-1').count(), 1);
    const after = { mug: await fromTint([0.785, 0.66]), wall: await fromTint(wall) };
    assert.ok(after.mug < 0.75 * before.mug, `${before.mug} to ${after.mug} from the tint`);
    assert.ok(Math.abs(after.wall - before.wall) < 3, `the wall: ${before.wall} to ${after.wall}`);
    assert.match(await id('what-moves').textContent(), new RegExp(`the ${whole.toLocaleString('en-US')} Gaussians`));
  });

  test('a brush takes a bit away, and undo gives it back', async () => {
    const { page, id, drag, count, answerTo } = desk;
    await id('select-tool-brush').click();
    await id('select-op').selectOption('subtract');
    const { asked } = await answerTo(() => drag(...mug.rim));
    assert.deepEqual([asked[1].op, asked[1].stroke.depth], ['subtract', 'visible']);
    const less = await count();
    assert.ok(less < whole && less > 0, `${less} of ${whole}`);
    await page.keyboard.press('Control+z');
    await page.waitForFunction((n) => document.querySelector('[data-testid=selection-count]').dataset.count === String(n), whole);
    assert.equal(await id('selection-remove-1').count(), 0);
    await page.keyboard.press('Control+Shift+z');
    await page.waitForFunction((n) => document.querySelector('[data-testid=selection-count]').dataset.count === String(n), less);
    await id('undo').click();
    assert.equal(await count(), whole);
  });

  test('a lasso goes around a thing, and a step can be removed', async () => {
    const { id, drag, count, answerTo } = desk;
    await id('select-tool-lasso').click();
    await id('select-op').selectOption('add');
    await id('select-depth-through').click();
    const { asked } = await answerTo(() => drag([0.16, 0.58], [0.27, 0.58], [0.27, 0.74], [0.16, 0.74]));
    assert.equal(asked[1].polygon.depth, 'through');
    assert.ok(await count() > whole);
    await id('selection-remove-1').click();
    await desk.page.waitForFunction((n) => document.querySelector('[data-testid=selection-count]').dataset.count === String(n), whole);
  });

  test('a rectangle goes around a thing, and what is selected is made wider and narrower', async () => {
    const { page, id, drag, count, answerTo } = desk;
    const until = (n) => page.waitForFunction((m) => document.querySelector('[data-testid=selection-count]').dataset.count === String(m), n);
    await id('select-tool-rectangle').click();
    const { asked } = await answerTo(() => drag([0.16, 0.58], [0.2, 0.7], [0.27, 0.74]));
    assert.equal(asked[1].polygon.points.length, 4);
    const more = await count();
    assert.ok(more > whole);
    await id('undo').click();
    await until(whole);
    const { asked: wider, answer } = await answerTo(() => id('expand-selection').click());
    assert.ok(wider[1].expand > 0 && answer.count > whole, `${answer.count} of ${whole}`);
    await until(answer.count);
    const { answer: less } = await answerTo(() => id('shrink-selection').click());
    assert.ok(less.count < answer.count);
    await until(less.count);
    await id('undo').click();
    await id('undo').click();
    await until(whole);
    await count();
  });

  test('what is selected is removed without a handle', async () => {
    const { page, id, complaints } = desk;
    const shown = () => page.getByTestId('picture').evaluate((canvas, [fx, fy]) =>
      [...canvas.getContext('2d').getImageData(fx * canvas.width, fy * canvas.height, 1, 1).data.slice(0, 3)], [0.785, 0.64]);
    await id('hand-handle').click();
    const before = await shown();
    assert.ok(await id('run').isDisabled(), 'nothing says where it should go');
    await id('settings').locator('summary').click();
    await id('mode-remove').click();
    const [response] = await Promise.all([
      page.waitForResponse((r) => r.url().endsWith('/v1/previews')),
      id('preview-answer').getByText(`Preview without ${whole.toLocaleString('en-US')} Gaussians`).waitFor(),
    ]);
    const asked = response.request().postDataJSON();
    assert.deepEqual([asked.mode, asked.handles], ['remove', []]);
    await page.waitForFunction(() => document.querySelector('[data-testid=view]').dataset.quality === 'full');
    await page.waitForFunction(() => document.querySelector('[data-testid=view]').dataset.version !== '0');
    const after = await shown();
    if (process.env.SPLATDRAG_SHOTS) await page.screenshot({ path: `${process.env.SPLATDRAG_SHOTS}/remove.png` });
    assert.ok(Math.hypot(...after.map((x, i) => x - before[i])) > 40, `${before} to ${after}: the mug is gone`);
    assert.ok(!(await id('run').isDisabled()));
    await id('mode-move').click();
    await id('settings').locator('summary').click();
    assert.deepEqual(complaints, []);
  });

  test('one handle drags what is selected, and the edit succeeds', async () => {
    const { service, page, id, click, complaints } = desk;
    await id('hand-handle').click();
    await click(mug.on[0]);
    const dot = await id('handle-0-source').boundingBox();
    await page.mouse.move(dot.x + dot.width / 2, dot.y + dot.height / 2);
    await page.mouse.down();
    await page.mouse.move(dot.x - 60, dot.y + 40, { steps: 8 });
    await page.mouse.up();
    await id('preview-answer').getByText('Preview of').waitFor();
    await id('handle-count-0').getByText(whole.toLocaleString('en-US')).waitFor();
    await id('settings').locator('summary').click();
    await id('preset').selectOption('draft');
    await id('param-corrector').selectOption('none');
    await id('param-iterations').fill('0');
    await id('param-views').fill('4');
    await id('param-max-image-side').fill('160');
    await id('param-max-image-side').blur();
    await id('run').click();
    await page.locator('[data-testid^="edit-e"][data-state=succeeded]').waitFor();
    const [edit] = (await service.client.get('/v1/edits')).json().edits;
    assert.equal(edit.handles[0].gaussians, whole);
    assert.equal(edit.request.selection.length, 1);
    assert.ok(edit.request.handles[0].radius > 0, 'which the service chose');
    await page.waitForFunction(() => document.querySelector('[data-testid=view]').dataset.version === '1');
    await id('edit-reuse').click();
    await id('selection-count').getByText('selected').waitFor();
    assert.equal(Number(await id('selection-count').getAttribute('data-count')), whole);
    assert.deepEqual(complaints, []);
  });

  test('is there for those who have no pointer', async () => {
    const { page, id, count } = desk;
    await id('clear-selection').click();
    await id('view').focus();
    await page.keyboard.press('s');
    await page.keyboard.press('2');
    await id('select-depth-visible').click();
    await id('view').focus();
    await page.keyboard.press('Enter');
    assert.ok(await count() > 0);
    await page.keyboard.press('Escape');
    assert.equal(await id('hand-handle').getAttribute('aria-pressed'), 'true');
  });
});

describe('selecting in a capture', () => {
  const capture = fox();
  test('four clicks select the head of the fox, and it is seen tinted', { skip: capture.absent ?? false }, async () => {
    const desk = await sceneOpen(capture.ply, capture.folder);
    const { page, id, click, count, fromTint, answerTo, complaints } = desk;
    const forehead = [0.551, 0.288];
    const before = await fromTint(forehead);
    await id('hand-select').click();
    await answerTo(() => click([0.551, 0.304]));
    await answerTo(() => click([0.496, 0.415]));
    await answerTo(() => click([0.38, 0.446], 'right'));  // the board it hangs on
    const { asked } = await answerTo(() => click([0.33, 0.304], 'right'));  // the wall
    assert.deepEqual([asked.length, asked[0].grow.inside.length, asked[0].grow.outside.length], [1, 2, 2]);
    const selected = await count();
    const whole = desk.scene.gaussians;
    assert.ok(selected > 200 && selected < whole / 2, `${selected} of ${whole}`);
    const after = await fromTint(forehead);
    assert.ok(after < 0.8 * before, `${before} to ${after} from the tint`);
    if (screenshot) await page.screenshot({ path: screenshot.replace(/(\.\w+)?$/, '_fox$1') });
    assert.deepEqual(complaints, []);
    await page.context().close();
    await desk.service.stop();
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
