// What is made of a drag, in a real browser: comparing, healing, running, and requests from files.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { ball, ballMoved, compared, makeDesk, makeRoom, openDesk, violations } from './support/desk.mjs';
import { root } from './support/program.mjs';

let room;
before(async () => {
  room = await makeRoom();
});
after(() => room?.close());

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

describe('two versions in one picture', () => {
  let desk, page, id, hand, complaints, at;
  before(async () => {
    desk = await makeDesk(room);
    assert.equal(await ballMoved(desk), 1);
    ({ page, id, hand, complaints } = await openDesk(desk));
    await hand.shown(1);
    at = await hand.onScreen(ball);
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });

  test('are shown one alone while the button or B is held; layers show depth and what was changed', async () => {
    const { x, y, width, height } = await id('compare').boundingBox();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await hand.shown(0);
    await page.mouse.up();
    await hand.shown(1);
    await page.keyboard.down('b');
    await hand.shown(0);
    await page.keyboard.up('b');
    await hand.shown(1);
    const layer = async (name) => {
      await id(`layer-${name}`).click();
      await page.waitForFunction((wanted) => {
        const { layer, quality } = document.querySelector('[data-testid=view]').dataset;
        return layer === wanted && quality === 'full';
      }, name);
    };
    const moved = await hand.onScreen(room.demo.ball.handles[0].target);
    const box = await id('view').boundingBox();
    const corner = [box.x + 0.95 * box.width, box.y + 0.05 * box.height];
    await layer('mask');
    assert.ok(apart(await colourAt(page, 'picture', moved), [255, 255, 255]) < 60, 'the ball has changed');
    assert.ok(apart(await colourAt(page, 'picture', corner), [0, 0, 0]) < 20, 'the wall has not');
    await layer('depth');
    const [ball, wall] = [await colourAt(page, 'picture', moved), await colourAt(page, 'picture', corner)];
    assert.ok(apart(ball, wall) > 20, `near ${ball}, far ${wall}`);
    await layer('color');
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
    await id('compare-place').fill('70');  // without a drag
    await id('compare-place').blur();
    assert.equal(await split(), 70);
    assert.match(await clip(), /^inset\(0(px)? 30% 0(px)? 0(px)?\)$/);
    await id('compare-place').fill('25');
    await id('compare-place').blur();
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
    desk = await makeDesk(room);
    ({ page, id, hand, complaints } = await openDesk(desk));
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
    desk = await makeDesk(room);
    ({ page, id, hand, complaints } = await openDesk(desk));
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
      await id('param-iterations').fill('1000');
      await id('param-intervals').fill('20');
      await id('param-intervals').blur();
      await id('run').click();
      await page.locator('[data-testid^="edit-e"][data-state=running]').waitFor();
    };
    await long();
    // Of the one that runs: the run before has one, too.
    const running = page.locator('[data-testid^="edit-e"][data-state=running]');
    await running.getByTestId('interval-1').waitFor({ timeout: 120_000 });
    const [answer] = await Promise.all([
      page.waitForResponse((r) => r.url().endsWith('/stop')),
      page.locator('[data-state=running] [data-testid=edit-stop]:enabled').click(),
    ]);
    const { finished_intervals: finished } = await answer.json();
    await page.locator('[data-testid^="edit-e"][data-state=running], [data-testid^="edit-e"][data-state=stop_requested]').waitFor({ state: 'detached', timeout: 120_000 });
    const [stopped] = (await desk.client.get('/v1/edits')).json().edits;
    assert.deepEqual([stopped.state, stopped.stopped_early], ['succeeded', true]);
    assert.equal(stopped.finished_intervals.length, finished.length, 'the one in work is given up, not waited for');
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
    desk = await makeDesk(room);
    ({ page, id, hand, complaints } = await openDesk(desk));
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

  test('goes into one as it is, with its mode, anchors and groups, and comes back; what it would take is said', async () => {
    await id('tab-button-drag').click();
    await id('region-on').uncheck();
    await id('clear-handles').click();
    await id('hand-handle').click();
    const mug = [1.3, -0.16, -0.6];
    await page.mouse.click(...await hand.onScreen(mug));
    await id('handle-card-0').getByTestId('group').fill('1');
    await id('handle-card-0').getByTestId('group').blur();
    await page.mouse.click(...await hand.onScreen(ball));
    await id('handle-card-1').getByTestId('group').fill('0');
    await id('handle-card-1').getByTestId('group').blur();
    await id('mode-extend').click();
    const { x, y, width, height } = await id('handle-1-source').boundingBox();
    const dot = [x + width / 2, y + height / 2];
    await hand.drag(dot, [dot[0] + 90, dot[1] - 10]);
    await previewed();
    await id('estimate').click();
    await id('estimate-answer').getByText(/about \d.* (ms|s|min) and .*B: \d+ interval/).waitFor();
    const [download] = await Promise.all([page.waitForEvent('download'), id('export').click()]);
    const file = await download.path();
    const { mode, handles } = JSON.parse(await readFile(file, 'utf8'));
    assert.equal(mode, 'extend');
    assert.deepEqual(handles.map(({ target, group }) => [Boolean(target), group]), [[false, 1], [true, 0]]);
    await id('clear-handles').click();
    await id('mode-move').click();
    await id('import-file').setInputFiles({ name: 'again.json', mimeType: 'application/json', buffer: await readFile(file) });
    await id('handle-card-1').waitFor();
    assert.equal(await id('mode-extend').getAttribute('aria-pressed'), 'true');
    const [again] = await Promise.all([page.waitForEvent('download'), id('export').click()]);
    assert.deepEqual(JSON.parse(await readFile(await again.path(), 'utf8')), JSON.parse(await readFile(file, 'utf8')));
  });
});
