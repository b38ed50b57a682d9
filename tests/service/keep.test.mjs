// What stays, in a real browser: versions, photos, other pages, a service that comes back; and all of it by fingers.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, afterEach, before, beforeEach, describe, test } from 'node:test';
import { fingerOn, openPage } from './support/browser.mjs';
import { ball, ballMoved, compared, makeDesk, makeRoom, openDesk, tooSmall, violations } from './support/desk.mjs';

let room;
before(async () => {
  room = await makeRoom();
});
after(() => room?.close());

describe('versions', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await makeDesk(room);
    for (const version of [1, 2]) assert.equal(await ballMoved(desk), version);
    ({ page, id, hand, complaints } = await openDesk(desk));
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
    const { formats } = (await desk.client.get('/v1/info')).json();
    assert.ok(formats.write.length > 4);
    for (const format of [...formats.write, 'original']) {
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
    const other = await openDesk(desk);
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
    await hand.shown(0);  // what it was made from
    // An edit of the one is in the list of the other, and does not take its screen.
    const made = await ballMoved(desk, { version: 2, back: true });
    for (const one of [page, other.page]) await one.getByTestId('toast').getByText(`Version ${made} is ready, made elsewhere`).waitFor();
    await hand.shown(0);
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
    const first = await draft(90);
    const other = await openDesk(desk);
    await other.hand.shown(first);
    // Who is looking at it is told what became of it, and goes on: meanwhile, since the message does not stay for long.
    const goneOn = async () => {
      const told = other.page.getByTestId('toast').filter({ hasText: `Version ${first} was a draft, and is gone: version ` });
      await told.waitFor({ timeout: 120_000 });
      assert.equal(await other.id('version-select').inputValue(), '0');  // its picture may take longer than that is told
      const text = await told.textContent();
      await told.getByRole('button', { name: 'Show' }).click();
      return text;
    };
    const [second, text] = await Promise.all([draft(110), goneOn()]);
    assert.ok(text.includes(`Version ${first} was a draft, and is gone: version ${second}`), text);
    await id(`version-${first}`).waitFor({ state: 'detached' });  // in the tree, whether that is seen or not
    await other.hand.shown(second);
    assert.deepEqual(other.complaints, []);
    await other.page.context().close();
    assert.ok(!(await there()).includes(first) && (await there()).includes(second));
    await id('tab-button-scene').click();
    await id(`version-${second}-keep`).click();
    const third = await draft(130);
    assert.ok((await there()).includes(second) && (await there()).includes(third));
    assert.deepEqual(complaints, []);
  });

  test('scenes are named and deleted where they are listed', async () => {
    await desk.client.upload(room.demo.ply, { name: 'another' });
    await id('home-link').click();
    const card = (name) => page.locator('[data-testid^=scene-s]').filter({ hasText: name });
    await card('another').getByTestId('scene-rename').click();
    await id('ask-input').fill('a copy');
    await id('ask-ok').click();
    await card('a copy').getByTestId('scene-delete').click();
    await id('confirm-no').click();
    await card('a copy').getByTestId('scene-delete').click();
    await id('confirm-yes').click();
    await card('a copy').waitFor({ state: 'detached' });
    assert.deepEqual((await desk.client.get('/v1/scenes')).json().scenes.map(({ id: one }) => one), [desk.scene]);
    await id(`scene-${desk.scene}`).getByTestId('scene-open').click();
    await id('workspace').waitFor();
  });

  test('a scene that somebody deletes is left', async () => {
    await desk.client.delete(`/v1/scenes/${desk.scene}`);
    await id('home').waitFor();
    await page.getByTestId('toast').getByText('This scene has been deleted').waitFor();
  });
});

describe('a service that goes away', () => {
  test('is said to, and the page goes on when it is back', async () => {
    const desk = await makeDesk(room);
    const { page, id, hand } = await openDesk(desk);
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
    const other = await desk.service.client.upload(room.demo.ply, { name: 'theirs' });
    await id(`scene-${other.id}`).waitFor();
    await page.context().close();
    await desk.service.stop();
  });
});

describe('a scene that is opened', () => {
  test('is on the screen before anything is known that the picture does not need', async (t) => {
    const desk = await makeDesk(room);
    t.after(() => desk.service.stop());
    await ballMoved(desk);
    const { page, id, complaints } = await openPage(room.browser, desk.service);
    await id(`scene-${desk.scene}`).waitFor();
    // Scene, views, picture: whatever else is asked for does not come until that is there.
    let picture;
    const isThere = new Promise((resolve) => (picture = resolve));
    const held = [];
    await page.route(/\/v1\//, async (route) => {
      const { pathname } = new URL(route.request().url());
      if (!/\/v1\/scenes\/s\d+(\/views|\/versions\/\d+\/render)?$/.test(pathname)) {
        held.push(pathname);
        await isThere;
      }
      await route.continue();
    });
    await id(`scene-${desk.scene}`).getByTestId('scene-open').click();
    await page.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.version !== undefined);
    assert.ok(held.includes('/v1/edits'), `${held}`);
    picture();
    await page.waitForFunction(() => document.querySelector('[data-testid=view]').dataset.quality === 'full');
    await id('edits').locator('[data-state=succeeded]').waitFor({ state: 'attached' });
    assert.deepEqual(complaints, []);
    await page.context().close();
  });
});

describe('photos', () => {
  let desk, page, id, hand, complaints;
  before(async () => {
    desk = await makeDesk(room);
    ({ page, id, hand, complaints } = await openDesk(desk));
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
    desk = await makeDesk(room);
    await ballMoved(desk);
    ({ page, id, hand, complaints } = await openDesk(desk, phone));
    touch = (await fingerOn(page)).drag;
  });
  after(async () => {
    await page?.context().close();
    await desk?.service.stop();
  });
  const check = async (state) => {
    await hand.shot(`phone-${state}`);
    assert.deepEqual(await violations(page), [], state);
    assert.deepEqual(await tooSmall(page), [], state);
  };

  test('the picture stays, above a sheet that holds the tools', async () => {
    const inSight = async (least) => {
      const { y, height } = await id('view').boundingBox();
      assert.ok(y >= 0 && y + height <= phone.viewport.height && height >= least, `${y} to ${y + height}`);
      assert.equal(await page.evaluate(() => document.documentElement.scrollHeight), phone.viewport.height, 'nothing scrolls it away');
    };
    await inSight(600);
    await check('folded');
    assert.equal(await id('tab-drag').isVisible(), false);
    for (const tab of ['edits', 'scene', 'drag']) {
      await id(`tab-button-${tab}`).tap();
      assert.ok(await id(`tab-${tab}`).isVisible());
      await inSight(300);
      await check(`sheet-${tab}`);
    }
    await id('settings').locator('summary').tap();
    await id('region-on').scrollIntoViewIfNeeded();
    await inSight(300);
    await id('settings').locator('summary').tap();
    await id('fold').tap();
    await inSight(600);
    await page.setViewportSize({ width: 844, height: 390 });
    await hand.shown(1);
    await check('on-its-side');
    await page.setViewportSize(phone.viewport);
    await hand.shown(1);
  });

  test('what is taken is moved by numbers', async () => {
    const at = await hand.onScreen([1.3, -0.16, -0.6]);
    await page.touchscreen.tap(...at);
    await hand.count();
    await id('thing-hold').tap();
    assert.ok(await id('shift-x').isVisible());
    await id('auto-repair').uncheck();
    await id('shift-x').fill('-0.3');
    await id('shift-x').blur();
    await hand.state('moved');
    await check('numbers');
    await id('thing-drop').tap();
    await id('fold').tap();
  });

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
    await id('hand-heal').click();  // as below: the last stroke on the picture was a moment ago
    await id('select-tool-brush').tap();
    const box = await id('view').boundingBox();
    await touch([box.x + 150, box.y + 0.7 * box.height], [box.x + 170, box.y + 0.7 * box.height], [box.x + 200, box.y + 0.7 * box.height]);
    await hand.count();
    await id('selected-chip').getByText('selected').waitFor();
    await check('heal');
    await id('undo').click();  // a tap right after a stroke that quick is taken by the browser to stop a fling
    await id('selected-chip').waitFor({ state: 'hidden' });
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

describe('by fingers, on a tablet', () => {
  const tablet = { viewport: { width: 820, height: 1180 }, hasTouch: true, isMobile: true };
  let desk, page, id, hand, complaints, finger;
  before(async () => {
    desk = await makeDesk(room);
  });
  beforeEach(async () => {
    ({ page, id, hand, complaints } = await openDesk(desk, tablet));
    finger = await fingerOn(page);
  });
  afterEach(async () => {
    assert.deepEqual(complaints, []);
    await page.context().close();
  });
  after(() => desk?.service.stop());
  const middle = async (name) => {
    const { x, y, width, height } = await id(name).boundingBox();
    return [x + width / 2, y + height / 2];
  };
  /// The browser takes a tap right after a quick drag to stop a fling.
  const pressAfterADrag = (name) => id(name).click();
  const another = async (than) => {
    await page.waitForFunction((n) => {
      const { count, waits } = document.querySelector('[data-testid=selection-count]').dataset;
      return count > 0 && waits === undefined && count !== String(n);
    }, than);
    return hand.count();
  };
  const tab = async (name) => {
    await id(`tab-button-${name}`).tap();
    await id(`tab-${name}`).waitFor();
  };

  test('a scene is looked at from near and far, from aside, along an axis, and flown through', async () => {
    const away = async () => {
      const { camera } = await hand.looksFrom();
      return Math.hypot(...camera.eye.map((x, i) => x - camera.target[i]));
    };
    const far = await away();
    const box = await id('view').boundingBox();
    const [cx, cy] = [box.x + box.width / 2, box.y + 0.3 * box.height];
    // Two fingers that part bring it nearer.
    await finger.together([0, 10, 20, 30].map((d) => [cx - 60 - d, cy]), [0, 10, 20, 30].map((d) => [cx + 60 + d, cy]));
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').value === '');
    assert.ok(await away() < 0.9 * far, `${await away()} of ${far}`);
    const { camera: near } = await hand.looksFrom();
    await finger.together([0, 10, 20, 30].map((d) => [cx - 60 + d, cy]), [0, 10, 20, 30].map((d) => [cx + 60 + d, cy]));
    const { camera: slid } = await hand.looksFrom();
    assert.ok(slid.target.some((x, i) => Math.abs(x - near.target[i]) > 0.01), 'together they take it aside');
    await pressAfterADrag('reset-view');
    await hand.shown(0);
    await pressAfterADrag('look-minus-y');
    const { camera } = await hand.looksFrom();
    const above = camera.eye.map((x, i) => x - camera.target[i]);
    assert.ok(above[1] < 0 && Math.hypot(above[0], above[2]) < 1e-6, `from above: ${above}`);
    await id('fly').tap();
    await finger.drag([cx, cy], [cx + 30, cy], [cx + 60, cy]);
    const { camera: turned } = await hand.looksFrom();
    assert.ok(turned.eye.every((x, i) => Math.abs(x - camera.eye[i]) < 1e-9) && turned.target.some((x, i) => x !== camera.target[i]), 'who flies looks around');
    await pressAfterADrag('fly');
  });

  test('a floor is told by three taps', async () => {
    const saved = () => page.waitForResponse((r) => r.request().method() === 'PATCH');
    await id('up-menu').tap();
    await id('floor-up').tap();
    const places = [];
    for (const point of [[-0.7, 0.05, -1], [0.5, 0.05, -1], [0.35, 0.05, -0.5]]) places.push(await hand.onScreen(point));
    for (const [i, place] of places.entries()) {
      const all = i === 2 ? saved() : null;
      await page.touchscreen.tap(...place);
      if (i < 2) await id('hint').getByText(`${2 - i} more`).waitFor();
      await all;
    }
    const { up } = (await desk.client.get(`/v1/scenes/${desk.scene}`)).json();
    assert.ok(up[1] < -0.98, `${up}`);
    await id('up-menu').tap();
    await Promise.all([saved(), id('reset-up').tap()]);
  });

  test('a thing is taken, pulled by the gizmo, repaired, run well, cancelled, compared by holding, and taken back', async () => {
    await id('auto-repair').evaluate((box) => box.click());  // in the folded sheet
    await page.touchscreen.tap(...await hand.onScreen(ball));
    const whole = await hand.count();
    if (await id('thing-more').isEnabled()) {
      await id('thing-more').tap();
      const more = await another(whole);
      assert.ok(more > whole);
      await id('thing-less').tap();
      assert.equal(await another(more), whole);
    }
    const [x, y] = await middle('gizmo-move-x');
    await finger.drag([x + 8, y], [x + 30, y], [x + 60, y], [x + 90, y]);
    await hand.state('moved');
    await hand.shot('tablet-gizmo');
    await pressAfterADrag('thing-repair');
    await hand.state('done');
    const [edit] = (await desk.client.get('/v1/edits')).json().edits;
    const [{ source, target }] = edit.request.handles;
    assert.ok(edit.handles[0].gaussians >= whole && target[0] - source[0] > 0.1 && Math.abs(target[1] - source[1]) < 1e-9, `${source} to ${target}`);
    await hand.shown(edit.result_version);
    await id('thing-better').tap();
    await tab('edits');
    await page.getByTestId('edit-cancel').and(page.locator(':visible')).tap();
    if (await id('confirm-yes').isVisible()) await id('confirm-yes').tap();
    await page.locator('[data-testid^=edit-e][data-state=cancelled]').waitFor();
    await page.getByTestId('thumb-1-0').first().tap();
    const scrub = await id('scrub').boundingBox();
    await finger.drag([scrub.x + 0.5 * scrub.width, scrub.y + scrub.height / 2], [scrub.x + 0.2 * scrub.width, scrub.y + scrub.height / 2], [scrub.x + 4, scrub.y + scrub.height / 2]);
    await id('scrub-line').getByText('as it was found').waitFor();
    await page.getByRole('button', { name: 'Close' }).click();
    await id('fold').tap();
    await hand.shown(edit.result_version);
    const held = await middle('compare');
    await finger.drag(held, { drop: false });
    await hand.shown(0);
    await finger.drop();
    await hand.shown(edit.result_version);
    await tab('scene');
    const [download] = await Promise.all([page.waitForEvent('download'), id(`download-${edit.result_version}-spz`).tap()]);
    assert.match(download.suggestedFilename(), /\.spz$/);
    await id('fold').tap();
    await id('thing-undo').tap();
    await hand.state('moved');
    await id('thing-drop').tap();
    await page.touchscreen.tap(...await hand.onScreen(ball));
    await hand.count();
    await id('thing-remove').tap();
    await hand.state('done');
    await id('thing-undo').tap();
    await hand.state('taken');
  });

  test('a selection is made by corners, a lasso, a brush, a sphere and a box', async () => {
    await id('hand-select').tap();
    await id('select-tool-rectangle').tap();
    const [bx, by] = await hand.onScreen(ball);
    await page.touchscreen.tap(bx - 60, by - 60);
    await page.touchscreen.tap(bx + 60, by + 60);
    const framed = await another(0);
    await id('select-op').selectOption('subtract');
    await id('select-tool-brush').tap();
    await finger.drag([bx - 30, by], [bx, by], [bx + 30, by]);
    const less = await another(framed);
    assert.ok(less < framed);
    await pressAfterADrag('select-tool-lasso');
    await id('select-op').selectOption('add');
    await finger.drag([bx - 80, by - 80], [bx + 80, by - 80], [bx + 80, by + 80], [bx - 80, by + 80], [bx - 80, by - 70]);
    const lasso = await another(less);
    assert.ok(lasso > less);
    await pressAfterADrag('select-tool-sphere');
    await id('select-op').selectOption('intersect');
    await finger.drag([bx, by], [bx + 20, by], [bx + 40, by]);
    const sphere = await another(lasso);
    assert.ok(sphere < lasso);
    await pressAfterADrag('select-tool-box');
    await id('select-op').selectOption('add');
    await finger.drag([bx, by], [bx + 30, by], [bx + 60, by]);
    const box = await another(sphere);
    const [fx, fy] = await middle('shape-minus-x');
    await finger.drag([fx, fy], [fx - 40, fy], [fx - 80, fy]);
    assert.ok(await another(box) > box, 'a face is pulled');
    assert.deepEqual(await violations(page), []);
  });
});
