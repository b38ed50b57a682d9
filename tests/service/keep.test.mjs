// What comes after a drag, in a real browser: comparing, healing, running, keeping; alone and with others.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { handOn, launch, openPage, patience } from './support/browser.mjs';
import { root, Service } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const ball = [-0.28, -0.21, -0.62];

let browser, axeSource, demo, zip;
before(async () => {
  browser = await launch();
  axeSource = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
  demo = await demoScene({ gaussians: 20_000, views: 16, size: '400x300' });
  zip = await datasetZip(demo.folder);
});
after(() => browser?.close());

/// What axe-core finds against WCAG 2.2 A and AA in the state that a page is in: [rule: elements].
const violations = async (page) => {
  await page.evaluate(axeSource);
  const found = await page.evaluate(() => window.axe.run(document, { runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa'] }));
  return found.violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target).join(', ')}`);
};

/// A service with the demo scene and its cameras.
const serviceWithScene = async () => {
  const service = await Service.start();
  const scene = await service.client.upload(demo.ply, { name: 'desk' });
  await service.client.putDataset(scene.id, zip);
  return { service, client: service.client, scene: scene.id };
};
/// The page of a scene, open.
const opened = async ({ service, scene }, options = {}) => {
  const made = await openPage(browser, service, { reducedMotion: 'reduce', ...options });
  await made.id(`scene-${scene}`).getByTestId('scene-open').click();
  const hand = handOn(made);
  await made.page.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.quality === 'full', null, { timeout: patience });
  return { ...made, hand };
};
/// The ball put elsewhere by an edit, or back again: the version that has it there.
const ballMoved = async ({ client, scene }, { version = 0, back = false } = {}) => {
  const [{ source, target, radius }] = demo.ball.handles;
  const handles = [back ? { source: target, target: source, radius } : { source, target, radius }];
  const { id } = await client.submit({ ...demo.ball, handles, scene, version });
  return (await client.succeeded(id)).result_version;
};
/// The mean colour of a few pixels of a canvas around a place, in CSS pixels of the picture.
const colourAt = (page, testid, [x, y]) => page.getByTestId(testid).evaluate((canvas, [px, py]) => {
  const box = canvas.getBoundingClientRect();
  const context = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height }).getContext('2d');
  context.drawImage(canvas, 0, 0);
  const at = [(px - box.left) / box.width * canvas.width, (py - box.top) / box.height * canvas.height];
  const { data } = context.getImageData(at[0] - 3, at[1] - 3, 7, 7);
  return [0, 1, 2].map((c) => data.reduce((sum, value, i) => (i % 4 === c ? sum + value : sum), 0) / 49);
}, [x, y]);
const apart = (a, b) => Math.hypot(...a.map((value, i) => value - b[i]));
const compared = (page, way) => page.waitForFunction((wanted) => document.querySelector('[data-testid=view]').dataset.compared === wanted, way);

describe('two versions in one picture', () => {
  let desk, page, id, hand, complaints, at;
  before(async () => {
    desk = await serviceWithScene();
    assert.equal(await ballMoved(desk), 1);
    ({ page, id, hand, complaints } = await opened(desk));
    await hand.shown(1);
    at = await hand.onScreen(ball);
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });

  test('are on both sides of a line that is moved by keys and by the mouse', async () => {
    await id('compare-mode').selectOption('slider');
    await compared(page, 'slider');
    const [now, before] = [await colourAt(page, 'picture', at), await colourAt(page, 'other', at)];
    assert.ok(apart(now, before) > 20, `where the ball was: ${now} and ${before}`);
    const split = async () => Number(await id('compare-split').inputValue());
    const clip = () => id('other').evaluate((canvas) => canvas.style.clipPath);
    assert.equal(await split(), 50);
    assert.match(await clip(), /^inset\(0(px)? 50% 0(px)? 0(px)?\)$/);
    await id('compare-split').focus();
    for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowRight');
    assert.equal(await split(), 52);
    const box = await id('view').boundingBox();
    await page.mouse.move(box.x + 0.52 * box.width, box.y + 40);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.25 * box.width, box.y + 40, { steps: 5 });
    await page.mouse.up();
    assert.ok(Math.abs(await split() - 25) < 3, `${await split()}`);
    assert.match(await id('compare-line').textContent(), /version 0 · right: version 1/);
    await hand.shot('compare-slider');
    assert.deepEqual(await violations(page), []);
    await page.mouse.move(box.x + 0.7 * box.width, box.y + 0.3 * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.7 * box.width + 60, box.y + 0.3 * box.height, { steps: 5 });
    await page.mouse.up();
    await hand.shown(1);
    await compared(page, 'slider');
    await page.keyboard.press('r');
    await hand.shown(1);
    await compared(page, 'slider');
  });

  test('come one after the other', async () => {
    await id('compare-mode').selectOption('blink');
    await compared(page, 'blink');
    for (const version of [0, 1, 0]) await id('compare-line').getByText(`Now: version ${version}`).waitFor();
  });

  test('differ where something was changed, and only there', async () => {
    await id('compare-mode').selectOption('difference');
    await compared(page, 'difference');
    const [share] = (await id('compare-line').textContent()).match(/[\d.]+(?= % of the picture differs)/);
    assert.ok(Number(share) > 0.2 && Number(share) < 25, `${share} %`);
    const box = await id('view').boundingBox();
    assert.ok(apart(await colourAt(page, 'other', await hand.onScreen(ball)), [0, 0, 0]) > 40);
    assert.ok(apart(await colourAt(page, 'other', [box.x + 0.95 * box.width, box.y + 0.05 * box.height]), [0, 0, 0]) < 1);
    await hand.shot('compare-difference');
  });

  test('the key for it goes through all ways, and the first version has nothing to be compared with', async () => {
    await page.keyboard.press('c');
    assert.equal(await id('compare-mode').inputValue(), '');
    await id('other').waitFor({ state: 'hidden' });
    await page.keyboard.press('c');
    await compared(page, 'slider');
    await id('version-select').selectOption('0');
    await id('compare-line').getByText('nothing to compare').waitFor();
    await id('compare-with').selectOption('1');
    await compared(page, 'slider');
    assert.deepEqual(complaints, []);
  });
});

describe('what is healed', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await serviceWithScene();
    ({ page, id, hand, complaints } = await opened(desk));
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });

  test('is marked with the tools that select, can be undone, and goes along with a drag', async () => {
    const at = await hand.onScreen(ball);
    await page.mouse.click(...at);
    await hand.count();
    await id('hand-heal').click();
    await page.getByRole('heading', { name: 'What is healed' }).waitFor();
    await id('no-selection').getByText('Nothing is marked').waitFor();
    await id('select-tool-brush').click();
    await hand.drag([at[0] + 50, at[1] + 28], [at[0] + 70, at[1] + 30]);
    const stain = await hand.count();
    await hand.shot('healing');
    await page.keyboard.press('Control+z');
    await id('no-selection').waitFor();
    await page.keyboard.press('Control+Shift+z');
    assert.equal(await hand.count(), stain);
    await id('hand-thing').click();
    const ours = await hand.count();
    assert.notEqual(ours, stain, 'what moves is another selection');
    await id('what-moves').getByText('heals').waitFor();
    await id('auto-repair').uncheck();
    await hand.drag(at, [at[0] + 120, at[1]]);
    await hand.state('moved');
    const [request] = await Promise.all([
      page.waitForRequest((r) => r.method() === 'POST' && r.url().endsWith('/v1/edits')),
      id('thing-repair').click(),
    ]);
    const { heal, selection } = request.postDataJSON();
    assert.equal(heal.length, 1);
    assert.ok(heal[0].stroke && selection[0].grow);
    await hand.state('done');
    const [edit] = (await desk.client.get('/v1/edits')).json().edits;
    assert.equal(edit.state, 'succeeded');
  });

  test('alone, a stain goes, and the surface goes on over it', async () => {
    await id('version-select').selectOption('0');
    await hand.shown(0);
    const at = await hand.onScreen(ball);
    await id('hand-heal').click();
    await hand.drag([at[0] + 50, at[1] + 28], [at[0] + 70, at[1] + 30]);
    const stain = await hand.count();
    await id('hand-handle').click();
    await id('settings').locator('summary').click();
    await id('preset').selectOption('draft');
    await id('run').click();
    await page.locator('[data-testid^="edit-e"][data-state=succeeded]').nth(1).waitFor({ timeout: 120_000 });
    const [edit] = (await desk.client.get('/v1/edits')).json().edits;
    assert.equal(edit.request.mode, 'remove');
    assert.ok(edit.uncovered.every(({ open }) => open === 0), 'the table goes on there');
    assert.ok(edit.gaussians.removed >= stain, `${edit.gaussians.removed} of ${stain}`);
    await hand.shown(edit.result_version);
    await hand.shot('healed');
    assert.deepEqual(complaints, []);
  });
});

describe('a run', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await serviceWithScene();
    ({ page, id, hand, complaints } = await opened(desk));
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });

  test('says what each preset takes, before it is chosen', async () => {
    const at = await hand.onScreen(ball);
    await id('auto-repair').uncheck();
    await page.mouse.click(...at);
    await hand.count();
    await hand.drag(at, [at[0] + 120, at[1]]);
    for (const preset of ['draft', 'standard', 'paper']) await id(`preset-cost-${preset}`).getByText(/\d+(\.\d)? (ms|s|min|h).*·.*B/).waitFor();
    assert.equal(await id('preset-standard').getAttribute('aria-pressed'), 'true');
    await hand.shot('presets');
    assert.deepEqual(await violations(page), []);
    await id('preset-draft').click();
    assert.equal(await id('preset').inputValue(), 'draft');
  });

  test('shows how the loss falls, and how the result came about', async () => {
    await id('settings').locator('summary').click();
    await id('param-iterations').fill('60');
    await id('param-intervals').fill('2');
    await id('param-views').fill('6');
    await id('param-max-image-side').fill('200');
    await id('param-max-image-side').blur();
    await id('run').click();
    const edit = page.locator('[data-testid^="edit-e"][data-state=succeeded]');
    await edit.waitFor({ timeout: 120_000 });
    await id('loss-curve').waitFor();
    assert.match(await id('loss-curve').getAttribute('aria-label'), /The loss, from [\d.e-]+ to [\d.e-]+/);
    await page.waitForFunction(() => document.querySelector('[data-testid=thumb-1-0] img')?.naturalWidth > 0);
    const cut = await page.evaluate(() => document.querySelector('[data-testid=thumb-1-0] img').style.objectViewBox);
    assert.match(cut, /^inset\(/);
    assert.notEqual(cut, 'inset(0%)', 'it shows what was edited, not all of the picture');
    await hand.shot('edit');
    await id('thumb-1-0').click();
    const steps = [];
    await id('scrub').focus();
    await page.keyboard.press('Home');
    const last = Number(await id('scrub').getAttribute('max'));
    for (let i = 0; i <= last; ++i) {
      steps.push(await id('scrub-line').textContent());
      await page.waitForFunction(() => document.querySelector('[data-testid=scrub-picture]').naturalWidth > 0);
      await page.keyboard.press('ArrowRight');
    }
    assert.equal(steps[0], 'Interval 1: as it was found');
    assert.match(steps.at(-1), /^Interval 2: optimised/);
    assert.equal(new Set(steps).size, steps.length);
    await hand.shot('scrubber');
    assert.deepEqual(await violations(page), []);
    await page.keyboard.press('Escape');
  });

  test('that is stopped ends at once with what it has, and one that is cancelled leaves nothing', async () => {
    await id('tab-button-drag').click();
    await page.keyboard.press('Control+z');
    await hand.state('moved');
    const long = async () => {
      await id('tab-button-drag').click();
      await id('param-iterations').fill('400');
      await id('param-intervals').fill('20');
      await id('param-intervals').blur();
      await id('run').click();
      await page.locator('[data-testid^="edit-e"][data-state=running]').waitFor();
    };
    await long();
    await id('interval-1').first().waitFor({ timeout: 120_000 });
    await page.locator('[data-state=running] [data-testid=edit-stop]:enabled').click();
    await page.locator('[data-testid^="edit-e"][data-state=running], [data-testid^="edit-e"][data-state=stop_requested]').waitFor({ state: 'detached', timeout: 120_000 });
    const [stopped] = (await desk.client.get('/v1/edits')).json().edits;
    assert.deepEqual([stopped.state, stopped.stopped_early], ['succeeded', true]);
    await hand.shown(stopped.result_version);
    await id('tab-button-drag').click();
    await page.keyboard.press('Control+z');
    await hand.state('moved');
    await long();
    await page.locator('[data-state=running] [data-testid=edit-cancel]').click();
    await id('confirm-yes').click();
    await page.locator('[data-testid^="edit-e"][data-state=cancelled]').waitFor();
    assert.deepEqual(complaints, []);
  });
});

describe('a request from a file', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await serviceWithScene();
    ({ page, id, hand, complaints } = await opened(desk));
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });
  const previewed = () => page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));

  test('as released with 3DGS-Drag is carried out on the demo scene, which it is of', async () => {
    await id('import-file').setInputFiles(path.join(root, 'proto/examples/released_config.json'));
    await previewed();
    await id('preview-answer').getByText('Preview of').waitFor();
    assert.equal(await id('handle-2').count(), 1);
    assert.ok(await id('region-on').isChecked());
  });

  test('whose box leaves nothing to move says so on the picture, whatever the panel shows, and the box can go', async () => {
    await id('settings').locator('summary').click();
    await id('region-center-x').fill('50');
    await id('region-center-x').blur();
    await id('notes').getByText('Refused').waitFor();
    await id('tab-button-scene').click();
    await hand.shot('refused');
    assert.ok(await id('note-no-region').isVisible());
    assert.deepEqual(await violations(page), []);
    await id('note-no-region').click();
    await previewed();
    await id('note-no-region').waitFor({ state: 'hidden' });
    await page.keyboard.press('Control+z');
    assert.ok(await id('region-on').isChecked(), 'undo covers the box');
    await id('hand-thing').click();
    assert.deepEqual(complaints.filter((text) => !/status of 422/.test(text)), []);
  });
});

describe('versions', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await serviceWithScene();
    for (const version of [1, 2]) assert.equal(await ballMoved(desk), version);
    ({ page, id, hand, complaints } = await opened(desk));
    await id('tab-button-scene').click();
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });

  test('are a tree: with names, gone on from, deleted, downloaded in any format', async () => {
    await id('version-1-name').click();
    await id('ask-input').fill('ball on the right');
    await id('ask-ok').click();
    await id('version-1').getByText('ball on the right').waitFor();
    await id('version-1-branch').click();
    await hand.shown(1);
    assert.equal(await id('tab-button-drag').getAttribute('aria-selected'), 'true');
    assert.equal(await ballMoved(desk, { version: 1, back: true }), 3);
    await id('tab-button-scene').click();
    await id('version-3').waitFor();
    const levels = await page.evaluate(() => [...document.querySelectorAll('.version')].map((row) => [row.querySelector('.version-head').dataset.testid, row.getAttribute('aria-level')]));
    assert.deepEqual(levels, [['version-0', '1'], ['version-2', '2'], ['version-1', '2'], ['version-3', '3']]);
    await hand.shot('versions');
    assert.deepEqual(await violations(page), []);
    for (const format of ['compressed_ply', 'original']) {
      const [download] = await Promise.all([page.waitForEvent('download'), id(`download-3-${format}`).click()]);
      assert.deepEqual(await readFile(await download.path()), await desk.client.file(desk.scene, 3, format), format);
    }
    await id('version-1-delete').click();
    await id('confirm-yes').click();
    await id('version-1').waitFor({ state: 'detached' });
    await hand.shown(0);
    await id('version-3').getByText('from 0').waitFor();
  });

  test('two pages stay in step', async () => {
    const other = await opened(desk);
    await other.id('tab-button-scene').click();
    await other.id('version-3-name').click();
    await other.id('ask-input').fill('theirs');
    await other.id('ask-ok').click();
    await id('version-3').getByText('theirs').waitFor();
    await id('version-3').click();
    await hand.shown(3);
    await other.id('version-3-delete').click();
    await other.id('confirm-yes').click();
    await id('version-3').waitFor({ state: 'detached' });
    await page.getByTestId('toast').getByText('Version 3 has been deleted').waitFor();
    await hand.shown(2);
    // An edit of the one is in the list of the other, and does not take its screen.
    const made = await ballMoved(desk, { version: 2, back: true });
    for (const one of [page, other.page]) await one.getByTestId('toast').getByText(`Version ${made} is ready, made elsewhere`).waitFor();
    await hand.shown(2);
    assert.deepEqual(other.complaints, []);
    await other.page.context().close();
  });

  test('a draft goes when a better one is there, unless it is kept', async () => {
    await id('version-select').selectOption('0');
    await id('hand-thing').click();
    await hand.shown(0);
    const at = await hand.onScreen(ball);
    const draft = async (by) => {
      await page.mouse.click(...at);
      await hand.count();
      await hand.drag(at, [at[0] + by, at[1]]);
      await hand.state('done');
      const shown = Number(await id('version-select').inputValue());
      await hand.shown(shown);
      await id('thing-undo').click();
      await page.waitForFunction(() => document.querySelector('[data-testid=version-select]').value === '0');
      await id('thing-drop').click();
      await hand.shown(0);
      return shown;
    };
    const there = async () => (await desk.client.get(`/v1/scenes/${desk.scene}`)).json().versions.map(({ version }) => version);
    const [first, second] = [await draft(90), await draft(110)];
    await id(`version-${first}`).waitFor({ state: 'detached' });  // in the tree, whether that is seen or not
    assert.ok(!(await there()).includes(first) && (await there()).includes(second));
    await id('tab-button-scene').click();
    await id(`version-${second}-keep`).click();
    const third = await draft(130);
    assert.ok((await there()).includes(second) && (await there()).includes(third));
    assert.deepEqual(complaints, []);
  });

  test('a scene that somebody deletes is left', async () => {
    await desk.client.delete(`/v1/scenes/${desk.scene}`);
    await id('home').waitFor();
    await page.getByTestId('toast').getByText('This scene has been deleted').waitFor();
  });
});

describe('a service that goes away', () => {
  test('is said to, and the page goes on when it is back', async () => {
    const desk = await serviceWithScene();
    const { page, id, hand } = await opened(desk);
    assert.equal(await id('away').isVisible(), false);
    desk.service.process.kill('SIGSTOP');
    await id('away').waitFor();
    await hand.shot('away');
    desk.service.process.kill('SIGCONT');
    await id('away').waitFor({ state: 'hidden' });
    await desk.service.kill();
    await id('away').waitFor();
    await desk.service.start({ there: true });
    await id('away').waitFor({ state: 'hidden' });
    await page.keyboard.press(']');
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').value === 'view_01.png');
    await hand.shown(0);
    await id('home-link').click();
    await id(`scene-${desk.scene}`).waitFor();
    desk.service.process.kill('SIGSTOP');
    await id('scenes-problem').getByText('does not answer').waitFor();
    desk.service.process.kill('SIGCONT');
    await id('scenes-problem').waitFor({ state: 'hidden' });
    const other = await desk.service.client.upload(demo.ply, { name: 'theirs' });
    await id(`scene-${other.id}`).waitFor();
    await page.context().close();
    await desk.service.stop();
  });
});

describe('photos', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await serviceWithScene();
    ({ page, id, hand, complaints } = await opened(desk));
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });

  test('lie over the picture of their camera, to the pixel', async () => {
    await id('photo-toggle').click();
    await page.waitForFunction(() => document.querySelector('[data-testid=photo]').naturalWidth > 0);
    await hand.shot('photo');
    // The demo scene's photos are renders of it: where it lies rightly, nothing differs.
    const differs = () => page.evaluate(() => {
      const [photo, picture] = ['photo', 'picture'].map((name) => document.querySelector(`[data-testid=${name}]`));
      const [over, under] = [photo.getBoundingClientRect(), picture.getBoundingClientRect()];
      const size = { width: photo.naturalWidth, height: photo.naturalHeight };
      const pixels = (draw) => {
        const context = Object.assign(document.createElement('canvas'), size).getContext('2d');
        draw(context);
        return context.getImageData(0, 0, size.width, size.height).data;
      };
      const factor = picture.width / under.width;
      const a = pixels((context) => context.drawImage(photo, 0, 0));
      const b = pixels((context) => context.drawImage(picture, (over.left - under.left) * factor, (over.top - under.top) * factor, over.width * factor, over.height * factor, 0, 0, size.width, size.height));
      return a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / a.length;
    });
    assert.ok(await differs() < 4, `${await differs()} of 255 on average`);
    await id('photo-strength').focus();
    await page.keyboard.press('Home');
    assert.equal(await id('photo').evaluate((img) => img.style.opacity), '0');
    assert.deepEqual(await violations(page), []);
    await page.keyboard.press('Escape');
    await id('view').focus();
    await page.keyboard.press('ArrowLeft');
    await id('photo').waitFor({ state: 'hidden' });
  });

  test('go with the dataset when that is removed', async () => {
    await id('tab-button-scene').click();
    await id('dataset-remove').click();
    await id('confirm-yes').click();
    await id('dataset').getByText('None.').waitFor();
    await page.waitForFunction(() => /Virtual views/.test(document.querySelector('[data-testid=view-select]').textContent));
    assert.equal((await desk.client.get(`/v1/scenes/${desk.scene}`)).json().dataset, null);
    assert.equal(await id('photo-toggle').isVisible(), false);
    assert.deepEqual(complaints, []);
  });
});

describe('by fingers, on a phone', () => {
  const phone = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true };
  let desk, page, id, hand, complaints, touch;
  before(async () => {
    desk = await serviceWithScene();
    await ballMoved(desk);
    ({ page, id, hand, complaints } = await opened(desk, phone));
    const session = await page.context().newCDPSession(page);
    touch = async (...places) => {
      const send = (type, points) => session.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y]) => ({ x, y })) });
      await send('touchStart', [places[0]]);
      for (const place of places.slice(1)) await send('touchMove', [place]);
      await send('touchEnd', []);
    };
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });
  /// No rule for access is broken, and all that can be pressed is large enough and within the page.
  const check = async (state) => {
    await hand.shot(`phone-${state}`);
    assert.deepEqual(await violations(page), [], state);
    assert.deepEqual(await page.evaluate(() => [...document.querySelectorAll('button, a[href], select, input:not([type=file]), summary')]
      .filter((element) => element.checkVisibility() && !element.closest('label'))
      .map((element) => ({ element, box: element.getBoundingClientRect() }))
      .filter(({ box }) => box.width > 0 && (box.height < 24 || box.width < 24 || box.right > innerWidth + 1))
      .map(({ element, box }) => `${element.dataset.testid ?? element.outerHTML.slice(0, 80)}: ${box.width}x${box.height} at ${box.left}`)), [], state);
  };

  test('the line between two versions is moved, and the rest of the picture turns', async () => {
    await id('compare-mode').selectOption('slider');
    await compared(page, 'slider');
    const box = await id('view').boundingBox();
    const middle = [box.x + box.width / 2, box.y + 0.8 * box.height];
    await touch(middle, ...[0.6, 0.7, 0.8].map((part) => [box.x + part * box.width, middle[1]]));
    assert.ok(Math.abs(Number(await id('compare-split').inputValue()) - 80) < 4, await id('compare-split').inputValue());
    await check('slider');
    await touch([box.x + 60, middle[1]], [box.x + 80, middle[1]], [box.x + 120, middle[1]]);
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').value === '');
    await hand.shown(1);
    await id('compare-mode').selectOption('difference');
    await compared(page, 'difference');
    await check('difference');
    await id('compare-mode').selectOption('');
  });

  test('what is healed is painted', async () => {
    await id('hand-heal').tap();
    await id('select-tool-brush').tap();
    const box = await id('view').boundingBox();
    await touch([box.x + 150, box.y + 0.7 * box.height], [box.x + 170, box.y + 0.7 * box.height], [box.x + 200, box.y + 0.7 * box.height]);
    await hand.count();
    await check('heal');
    await id('undo').tap();
    await id('no-selection').waitFor();
    await id('hand-thing').tap();
  });

  test('versions are named and deleted, and an edit is looked at step by step', async () => {
    await id('tab-button-scene').tap();
    await id('version-1-name').tap();
    await id('ask-input').fill('by thumb');
    await id('ask-ok').tap();
    await id('version-1').getByText('by thumb').waitFor();
    await check('versions');
    await id('tab-button-edits').tap();
    await id('thumb-1-0').tap();
    await page.waitForFunction(() => document.querySelector('[data-testid=scrub-picture]').naturalWidth > 0);
    await check('steps');
    await page.getByRole('button', { name: 'Close' }).tap();
    await id('tab-button-scene').tap();
    await id('version-1-delete').tap();
    await id('confirm-yes').tap();
    await hand.shown(0);
    assert.deepEqual(complaints, []);
  });
});
