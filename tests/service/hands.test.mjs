// Hands on the thing: the gizmo, depth and surfaces, views, and shapes that select, in a real browser on a small scene.
import assert from 'node:assert/strict';
import { after, before, beforeEach, afterEach, describe, test } from 'node:test';
import { handOn, launch, openPage } from './support/browser.mjs';
import { compared } from './support/desk.mjs';
import { Service } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

// The mug of the demo scene, which stands on the table; y points down.
const mug = [1.3, -0.16, -0.6];

let browser, demo, service, scene;
before(async () => {
  browser = await launch();
  demo = await demoScene({ gaussians: 20_000, views: 24, size: '800x600', photos: false });
  service = await Service.start();
  scene = await service.client.upload(demo.ply, { name: 'desk' });
  await service.client.putDataset(scene.id, await datasetZip(demo.folder));
});
after(async () => {
  await browser?.close();
  await service?.stop();
});

let page, id, hand, complaints;
beforeEach(async () => {
  ({ page, id, complaints } = await openPage(browser, service, { viewport: { width: 1366, height: 768 } }));
  hand = handOn({ page, id });
  await id(`scene-${scene.id}`).getByTestId('scene-open').click();
  await hand.shown(0);
});
afterEach(async () => {
  assert.deepEqual(complaints, []);
  await page.context().close();
});

const middle = async (name) => {
  const { x, y, width, height } = await id(name).boundingBox();
  return [x + width / 2, y + height / 2];
};
const numbers = (name) => Promise.all(['x', 'y', 'z'].map(async (axis) => Number(await id(`${name}-${axis}`).inputValue())));
/// Takes the mug, to be moved without being repaired.
const take = async () => {
  await id('auto-repair').uncheck();
  const at = await hand.onScreen(mug);
  await page.mouse.click(...at);
  await hand.count();
  await id('gizmo').locator('.part').first().waitFor();
  return at;
};
/// What is asked for when something is done that leads to a preview: the newest request whose handle is `as` it should be.
const previewOf = async (act, as = () => true) => {
  const [response] = await Promise.all([
    page.waitForResponse((r) => r.url().endsWith('/v1/previews') && as(r.request().postDataJSON().handles[0])),
    act(),
  ]);
  assert.equal(response.status(), 200, await response.text());
  return response.request().postDataJSON();
};
const shiftOf = ({ source, target }) => target.map((x, i) => x - source[i]);

describe('the gizmo', () => {
  test('moves along one axis by its arrow, and says by how much', async () => {
    await take();
    const [x, y] = await middle('gizmo-move-x');
    const { selection, handles } = await previewOf(() => hand.drag([x + 10, y], [x + 110, y + 30]), (handle) => shiftOf(handle)[0] > 0.2);
    assert.equal(selection.length, 1);
    const [along, ...aside] = shiftOf(handles[0]);
    assert.ok(aside.every((a) => Math.abs(a) < 1e-9), `${aside}`);
    await hand.state('moved');
    const [shown] = await numbers('shift');
    assert.ok(shown >= along - 1e-4, `${shown} shown, ${along} asked for on the way`);
    await hand.shot('hands-moved');
    await page.keyboard.press('Control+z');
    assert.deepEqual(await numbers('shift'), [0, 0, 0], 'one step');
  });

  test('moves in a plane by its square', async () => {
    await take();
    const [x, y] = await middle('gizmo-move-zx');
    const { handles } = await previewOf(() => hand.drag([x, y], [x - 60, y + 20]), (handle) => Math.hypot(...shiftOf(handle)) > 0.1);
    const [along, up, ahead] = shiftOf(handles[0]);
    assert.ok(Math.abs(up) < 1e-9 && Math.abs(along) > 1e-3 && Math.abs(ahead) > 1e-3, `${[along, up, ahead]}`);
  });

  test('turns by a ring, and by arrow keys, in the frame that was chosen', async () => {
    await take();
    await page.keyboard.press('g');
    await id('gizmo-turn-y').focus();
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('Shift+ArrowRight');
    assert.deepEqual(await numbers('turn'), [0, 9, 0]);
    await page.keyboard.press('w');
    assert.equal(await id('frame-view').getAttribute('aria-pressed'), 'true');
    const ring = await id('gizmo-turn-view').boundingBox();
    const [cx, cy, r] = [ring.x + ring.width / 2, ring.y + ring.height / 2, 0.5 * (ring.width - 20)];
    const before = await numbers('turn');
    await hand.drag([cx + r, cy], [cx, cy - r]);
    const after = await numbers('turn');
    assert.ok(after[2] - before[2] > 60 && after[2] - before[2] < 120, `from ${before} to ${after}: a quarter of a turn`);
    await hand.shot('hands-turned');
  });

  test('takes all of it as numbers, and what it is joined to is said', async () => {
    await take();
    const type = async (name, value) => {
      await id(name).fill(value);
      await id(name).blur();
    };
    await type('shift-x', '-0.4');
    await type('turn-y', '90');
    await id('attach-free').click();
    const { attach, handles } = await previewOf(() => type('size', '1.5'), ({ scale }) => scale === 1.5);
    assert.equal(attach, 'free');
    assert.deepEqual([handles[0].scale, handles[0].rotation.map((x) => Number(x.toFixed(6)))], [1.5, [0.707107, 0, 0.707107, 0]]);
    await id('attach-answer').getByText('Comes off').waitFor();
    // And by the bar on the picture, for who does not look at the panel.
    await id('attach-held').click();
    await id('attach-answer').getByText('Held').waitFor();
    await id('thing-free').press('Enter');
    await page.waitForFunction(() => document.activeElement.dataset.testid === 'thing-repair');
    await id('attach-answer').getByText('Comes off').waitFor();
    await id('thing-free').waitFor({ state: 'hidden' });
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    await hand.shot('hands-numbers');
    await type('turn-y', '0');
    await type('size', '1');
    assert.deepEqual(await numbers('turn'), [0, 0, 0]);
    assert.deepEqual((await numbers('shift')).map((x) => Number(x.toFixed(4))), [-0.4, 0, 0], 'about its middle: that is where it was');
  });

  test('moves along the normal of the surface that was clicked on', async () => {
    await take();
    await id('frame-surface').click();
    await id('gizmo-move-z').focus();
    const { handles } = await previewOf(() => page.keyboard.press('ArrowRight'));
    assert.deepEqual((await numbers('shift')).map((x) => Math.abs(x) > 1e-9), [false, false, true]);
    const { camera } = await hand.looksFrom();
    const away = shiftOf(handles[0]).reduce((sum, x, i) => sum + x * (camera.eye[i] - mug[i]), 0);
    assert.ok(away > 0, 'its normal points at who sees it');
  });

  test('sizes by its knob', async () => {
    await take();
    await id('gizmo-tool-size').click();
    const { x, y, width } = await id('gizmo-size').boundingBox();
    await hand.drag([x + width - 16, y + 16], [x + width + 44, y - 44]);
    assert.ok(Number(await id('size').inputValue()) > 1.3, await id('size').inputValue());
  });

  test('is that of a handle, too', async () => {
    await id('hand-handle').click();
    await page.mouse.click(...await hand.onScreen(mug));
    await id('gizmo-move-y').focus();
    await page.keyboard.press('ArrowLeft');
    const [x, y, z] = await numbers('shift');
    assert.ok(x === 0 && y < 0 && z === 0, `${[x, y, z]}`);
    await id('handle-0-target').waitFor();
  });
});

describe('depth', () => {
  test('a thing that is dragged on surfaces stands on the table wherever the pointer is on it', async () => {
    const at = await take();
    await id('constraint-surface').click();
    await hand.drag(at, [at[0] - 260, at[1] + 30]);
    await hand.state('moved');
    const [x, y, z] = await numbers('shift');
    assert.ok(x < -0.3, `${[x, y, z]}`);
    assert.ok(Math.abs(y) < 0.12, `it neither floats nor sinks: ${y}`);
    await id('ghost').and(page.locator('[d]')).waitFor();
    await id('drop-line').and(page.locator('[d]')).waitFor();
    const [drop, ghost] = await Promise.all(['drop-line', 'ghost'].map((name) => id(name).boundingBox()));
    assert.ok(Math.abs(drop.y + drop.height - ghost.y - ghost.height) < 40, `down to the table it stands on: ${JSON.stringify({ drop, ghost })}`);
    await hand.shot('hands-surface');
  });

  test('a click on what a preview shows hits what is seen', async () => {
    const at = await take();
    await hand.drag(at, [at[0] - 320, at[1] - 60]);
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    const [response] = await Promise.all([
      page.waitForResponse((r) => r.url().endsWith('/pick') && r.request().postDataJSON().x > 100),
      page.mouse.click(...at),
    ]);
    assert.match(response.url(), /versions\/p\d+\/pick$/, 'the preview, where the mug is gone');
    await page.waitForFunction(() => document.querySelector('[data-testid=thing-bar]').dataset.state === 'taken');
    const { point } = await response.json();
    const [step] = await id('selection-steps').locator('li').allTextContents();
    assert.match(step, /a whole thing/);
    assert.ok(Math.hypot(...point.map((x, i) => x - mug[i])) > 0.1, `${point} is not the mug's`);
  });

  test('a handle behind a thing is drawn as hidden', async () => {
    await id('hand-handle').click();
    await page.mouse.click(...await hand.onScreen(mug));
    await id('handle-card-0').waitFor();
    assert.equal(await id('handle-0-source').getAttribute('data-behind'), null);
    await id('look-z').focus();
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => document.querySelector('[data-testid=handle-0-source]').hasAttribute('data-behind'));
    await hand.shot('hands-behind');
  });
});

describe('the view', () => {
  test('looks along an axis of the widget, about the same point', async () => {
    const before = (await hand.looksFrom()).camera;
    await id('look-minus-y').click();
    const { camera } = await hand.looksFrom();
    assert.deepEqual(camera.target, before.target);
    const away = camera.eye.map((x, i) => x - camera.target[i]);
    assert.ok(away[1] < 0 && Math.hypot(away[0], away[2]) < 1e-6, `from above: ${away}`);
  });

  test('is turned, moved aside and brought nearer by buttons alone', async () => {
    const minus = (a, b) => a.map((x, i) => x - b[i]);
    const away = ({ eye, target }) => Math.hypot(...minus(eye, target));
    const press = async (name) => {
      await id(`turn-${name}`).click();
      return (await hand.looksFrom()).camera;
    };
    const { camera: start } = await hand.looksFrom();
    await id('turn-menu').click();
    const turned = await press('left');
    assert.deepEqual(turned.target, start.target);
    assert.ok(Math.hypot(...minus(turned.eye, start.eye)) > 0.05 * away(start) && Math.abs(away(turned) - away(start)) < 1e-9, 'about the same point');
    const near = await press('nearer');
    assert.ok(away(near) < 0.9 * away(turned), `${away(near)} of ${away(turned)}`);
    await id('turn-way-slide').click();
    const slid = await press('up');
    assert.ok(minus(slid.eye, near.eye).every((x, i) => Math.abs(x - minus(slid.target, near.target)[i]) < 1e-9), 'aside, and not turned');
    assert.ok(slid.eye[1] < near.eye[1], 'up: y points down');
    await page.keyboard.press('Escape');
    assert.equal(await id('turn-left').isVisible(), false);
  });

  test('several pictures are on their way at once while it moves, and over a slow network none is smaller for that', async () => {
    const session = await page.context().newCDPSession(page);
    const slow = (latency) => session.send('Network.emulateNetworkConditions', { offline: false, latency, downloadThroughput: -1, uploadThroughput: -1 });
    let [underWay, most] = [0, 0];
    const isPicture = (request) => request.url().endsWith('/render');
    page.on('request', (request) => isPicture(request) && (most = Math.max(most, (underWay += 1))));
    for (const name of ['requestfinished', 'requestfailed']) page.on(name, (request) => isPicture(request) && (underWay -= 1));
    await page.evaluate(() => {
      window.widths = [];
      document.querySelector('[data-testid=view]').addEventListener('shown', ({ detail }) => window.widths.push(detail.size.width));
    });
    const box = await id('view').boundingBox();
    const [x, y] = [box.x + 0.9 * box.width, box.y + 0.2 * box.height];
    await page.mouse.move(x, y);
    await page.mouse.down();
    /// How wide pictures are once so many have come: the widest of the last ones, since one may be slow by chance.
    const settled = async (pictures) => {
      await page.evaluate(() => (window.widths = []));
      const until = Date.now() + 60_000;
      for (let i = 1; (await page.evaluate(() => window.widths.length)) < pictures; ++i) {
        assert.ok(Date.now() < until, `no ${pictures} pictures within a minute`);
        await page.mouse.move(x - 100 + 100 * Math.cos(i / 10), y);
        await page.waitForTimeout(20);
      }
      return page.evaluate(() => Math.max(...window.widths.slice(-5)));
    };
    const near = await settled(10);
    await slow(400);
    most = 0;
    const far = await settled(12);
    await page.mouse.up();
    await slow(0);
    assert.ok(most >= 2, `${most} at once`);
    assert.ok(far >= 0.5 * near, `${far} pixels wide, and ${near} without the way there and back`);
  });

  test('flies where it looks while keys are held, and a drag looks around', async () => {
    const { camera: before } = await hand.looksFrom();
    await id('fly').click();
    assert.equal(await id('fly').getAttribute('aria-pressed'), 'true');
    await page.keyboard.down('w');
    await page.waitForTimeout(400);
    await page.keyboard.up('w');
    const { camera: ahead, box } = await hand.looksFrom();
    const minus = (a, b) => a.map((x, i) => x - b[i]);
    const forward = minus(before.target, before.eye);
    const gone = minus(ahead.eye, before.eye);
    const along = gone.reduce((sum, x, i) => sum + x * forward[i], 0) / Math.hypot(...forward);
    assert.ok(along > 0.03 * Math.hypot(...forward) && Math.hypot(...gone) - along < 1e-6 * along, `${gone}`);
    minus(ahead.target, before.target).forEach((x, i) => assert.ok(Math.abs(x - gone[i]) < 1e-9, 'the pivot comes along'));
    await hand.drag([box.x + 300, box.y + 150], [box.x + 400, box.y + 150]);
    const { camera: turned } = await hand.looksFrom();
    assert.deepEqual(turned.eye, ahead.eye);
    assert.ok(Math.hypot(...minus(turned.target, ahead.target)) > 0.1);
    await hand.shot('hands-flying');
    await page.keyboard.press('Escape');
    assert.equal(await id('fly').getAttribute('aria-pressed'), 'false');
    await page.keyboard.press('d');
    assert.deepEqual((await hand.looksFrom()).camera.eye, ahead.eye);
  });

  test('up is as the cameras were held, can be flipped, and told by three clicks on the table', async () => {
    const up = async () => (await service.client.get(`/v1/scenes/${scene.id}`)).json().up;
    const saved = () => page.waitForResponse((r) => r.request().method() === 'PATCH');
    const choose = async (name) => {
      await id('up-menu').click();
      await id(name).click();
    };
    await Promise.all([saved(), choose('flip-up')]);
    assert.ok((await up())[1] > 0.99, 'the table of the demo scene is level: y points down');
    await Promise.all([saved(), choose('reset-up')]);
    assert.equal(await up(), null);
    await choose('floor-up');
    await id('hint').getByText('three places').waitFor();
    const table = [[-1, 0.05, -0.9], [0.6, 0.05, -0.9], [1.9, 0.05, 0.2]];
    const places = [];
    for (const point of table) places.push(await hand.onScreen(point));
    for (const [i, place] of places.entries()) {
      const picked = page.waitForResponse((r) => r.url().endsWith('/pick'));
      const done = i === 2 ? saved() : null;
      await page.mouse.click(...place);
      await picked;
      await done;
      if (i < 2) await id('hint').getByText(`${2 - i} more`).waitFor();
    }
    const found = await up();
    assert.ok(found[1] < -0.98, `${found}`);
    await Promise.all([saved(), choose('reset-up')]);
  });

  test('a scene without cameras is seen whole when it is opened', async () => {
    const other = await service.client.upload(demo.ply, { name: 'no cameras' });
    await page.evaluate((name) => (location.hash = `#/scenes/${name}`), other.id);
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').textContent.includes('Virtual'));
    await hand.shown(0);
    for (const corner of [mug, [-1.4, 0.05, -0.8]]) {
      const [x, y] = await hand.onScreen(corner);
      const box = await id('view').boundingBox();
      assert.ok(x > box.x && x < box.x + box.width && y > box.y && y < box.y + box.height, `${corner} at ${[x, y]}`);
    }
    await service.client.delete(`/v1/scenes/${other.id}`);
  });
});

describe('who has no pointer', () => {
  /** Goes on from element to element until one has the focus. */
  const tabTo = async (name) => {
    for (let i = 0; i < 120; ++i) {
      await page.keyboard.press('Tab');
      if (await page.evaluate((wanted) => document.activeElement?.dataset.testid === wanted, name)) return;
    }
    assert.fail(`${name} is not to be reached`);
  };
  const press = async (name, key = 'Enter') => {
    await tabTo(name);
    await page.keyboard.press(key);
  };
  const aim = async (point) => {
    await tabTo('view');
    await hand.aim(point);
  };

  test('takes a thing, moves it, has it repaired and goes back, by keys alone', async (t) => {
    t.after(async () => {
      // As it was, for those that come next, whatever happens here.
      const at = `/v1/scenes/${scene.id}`;
      const { versions } = (await service.client.get(at)).json();
      for (const { version } of versions.slice(1)) await service.client.delete(`${at}/versions/${version}`);
    });
    await page.keyboard.press('Escape');
    await aim(mug);
    await page.keyboard.press('Enter');
    const count = await hand.count();
    await press('thing-hold');
    await page.waitForFunction(() => document.activeElement.dataset.testid === 'handle-0-target');
    for (let i = 0; i < 12; ++i) await page.keyboard.press('ArrowLeft');
    await hand.state('moved');
    await press('thing-repair');
    await hand.state('done');
    const [edit] = (await service.client.get('/v1/edits')).json().edits;
    assert.deepEqual([edit.state, edit.handles[0].gaussians >= count], ['succeeded', true]);
    await hand.shown(edit.result_version);
    await page.keyboard.press('Control+z');
    await hand.state('moved');
    await tabTo('tab-button-drag');
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('ArrowRight');
    await press(`version-${edit.result_version}-delete`);
    await page.waitForFunction(() => document.activeElement.dataset.testid === 'confirm-no');
    await page.keyboard.press('Tab');
    await page.keyboard.press('Enter');
    await id(`version-${edit.result_version}`).waitFor({ state: 'detached' });
  });

  test('selects with each tool that does not draw, and more, less, only that, all but that', async () => {
    const another = async (act, than) => {
      await act();
      await page.waitForFunction((n) => {
        const { count, waits } = document.querySelector('[data-testid=selection-count]').dataset;
        return count > 0 && waits === undefined && count !== String(n);
      }, than);
      return hand.count();
    };
    const keys = (...names) => async () => {
      for (const name of names) await page.keyboard.press(name);
    };
    await aim(mug);
    const whole = await another(keys('Enter'), 0);
    const less = await another(keys(','), whole);
    assert.ok(less < whole, `${less} of ${whole}`);
    assert.equal(await another(keys('.'), less), whole);
    await page.keyboard.press('Escape');

    await tabTo('view');
    const grown = await another(keys('s', '1', 'Enter'), 0);
    await tabTo('view');
    const dab = await another(keys('2', 'Alt+Enter'), grown);
    assert.ok(dab < grown, `${dab}: with Alt it is taken away`);
    await tabTo('view');
    const sphere = await another(keys('5', 'Enter'), dab);
    assert.ok(sphere > dab);
    await press('select-op', 'ArrowDown');
    await page.keyboard.press('ArrowDown');
    assert.equal(await id('select-op').inputValue(), 'intersect');
    await tabTo('view');
    const both = await another(keys('6', 'Enter'), sphere);
    assert.ok(both < sphere, `${both} of ${sphere}`);
    const { gaussians } = (await service.client.get(`/v1/scenes/${scene.id}`)).json();
    assert.equal(await another(() => press('invert-selection'), both), gaussians - both);
    await another(keys('Control+z'), gaussians - both);
    const wider = await another(() => press('expand-selection'), both);
    assert.ok(wider > both);
    assert.ok(await another(() => press('shrink-selection'), wider) < wider);
    await press('clear-selection');
    await id('no-selection').waitFor();
    await tabTo('view');
    const healed = await another(keys('e', '2', 'Enter'), 0);
    await page.getByRole('heading', { name: 'What is healed' }).waitFor();
    assert.ok(healed < grown);
  });

  test('looks around, removes a thing, compares, has it run well, thinks better of it, and takes files along', async () => {
    await aim(mug);
    const { camera } = await hand.looksFrom();
    await page.keyboard.press('f');
    await page.waitForFunction((before) => JSON.parse(localStorage.getItem(before.at))?.pose?.target?.join() !== before.target,
      { at: `splatdrag.scene.${scene.id}`, target: camera.target.join() });
    const near = async () => {
      const { camera: { eye, target } } = await hand.looksFrom();
      return Math.hypot(...eye.map((x, i) => x - target[i]));
    };
    const far = await near();
    await page.keyboard.press('+');
    assert.ok(await near() < far);
    await page.keyboard.press('-');
    await page.keyboard.press(']');
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').value === 'view_01.png');
    await page.keyboard.press('r');
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').value === 'view_00.png');
    for (const [key, constraint] of [['u', 'surface'], ['l', 'level'], ['x', 'x'], ['n', 'normal'], ['v', 'view']]) {
      await page.keyboard.press(key);
      assert.equal(await id(`constraint-${constraint}`).getAttribute('aria-pressed'), 'true');
    }

    await aim(mug);
    await page.keyboard.press('Enter');
    await hand.count();
    await press('thing-remove');
    await hand.state('done');
    const [{ result_version: made }] = (await service.client.get('/v1/edits')).json().edits;
    await hand.shown(made);
    await page.keyboard.down('b');
    await hand.shown(0);
    await page.keyboard.up('b');
    await hand.shown(made);
    await page.keyboard.press('c');
    await compared(page, 'slider');
    for (let i = 0; i < 3; ++i) await page.keyboard.press('c');
    assert.equal(await id('compare-mode').inputValue(), '');
    await press('thing-better');
    const running = page.locator('[data-testid^=edit-e]:is([data-state=queued], [data-state=running])');
    await running.waitFor({ state: 'attached' });
    await tabTo('tab-button-drag');
    await page.keyboard.press('ArrowRight');
    await press('edit-cancel');
    if (await id('confirm-yes').isVisible()) await press('confirm-yes');
    await page.locator('[data-testid^=edit-e][data-state=cancelled]').waitFor();
    await page.keyboard.press('Control+z');
    await hand.shown(0);

    await tabTo('tab-button-edits');
    await page.keyboard.press('ArrowRight');
    const [download] = await Promise.all([page.waitForEvent('download'), press('download-0-splat')]);
    assert.match(download.suggestedFilename(), /\.splat$/);
    await press(`version-${made}-delete`);
    await page.waitForFunction(() => document.activeElement.dataset.testid === 'confirm-no');
    await press('confirm-yes');
    await id(`version-${made}`).waitFor({ state: 'detached' });
    await tabTo('tab-button-scene');
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('ArrowLeft');
    const [file] = await Promise.all([page.waitForEvent('download'), press('export')]);
    assert.match(file.suggestedFilename(), /\.json$/);
  });

  test('says which way is up', async () => {
    const saved = () => page.waitForResponse((r) => r.request().method() === 'PATCH');
    await press('up-menu');
    await press('floor-up');
    const table = [[-1, 0.05, -0.9], [0.6, 0.05, -0.9], [1.9, 0.05, 0.2]];
    for (const [i, point] of table.entries()) {
      await aim(point);
      const all = i === 2 ? saved() : null;
      await page.keyboard.press('Enter');
      if (i < 2) await id('hint').getByText(`${2 - i} more`).waitFor();
      await all;
    }
    const { up } = (await service.client.get(`/v1/scenes/${scene.id}`)).json();
    assert.ok(up[1] < -0.95, `${up}`);
    await press('up-menu');
    await Promise.all([saved(), press('reset-up')]);
  });
});

describe('who does not draw', () => {
  const steps = () => id('selection-steps').locator('li').allTextContents();
  const click = async (...places) => {
    for (const [x, y] of places) await page.mouse.click(x, y);
  };

  test('clicks the corners of a frame and of a lasso, and what both hold is kept', async () => {
    const [x, y] = await hand.onScreen(mug);
    await page.keyboard.press('s');
    await id('select-tool-rectangle').click();
    await click([x - 70, y - 70]);
    await page.mouse.move(x, y);
    await hand.shot('hands-corners');
    await click([x + 70, y + 70]);
    const framed = await hand.count();
    await id('select-tool-lasso').click();
    await id('select-op').selectOption('intersect');
    const corners = [[x - 70, y - 70], [x + 70, y - 70], [x - 70, y + 70]];
    await click(...corners);
    assert.equal((await steps()).length, 1, 'a lasso ends where it began');
    await click([x - 66, y - 67]);
    await page.waitForFunction((n) => Number(document.querySelector('[data-testid=selection-count]').dataset.count) < n, framed);
    const both = await hand.count();
    assert.ok(both > 0.1 * framed, `${both} of ${framed}`);
    await id('invert-selection').click();
    await page.waitForFunction((n) => Number(document.querySelector('[data-testid=selection-count]').dataset.count) > n, framed);
    const { gaussians } = (await service.client.get(`/v1/scenes/${scene.id}`)).json();
    assert.equal(await hand.count(), gaussians - both);
  });

  test('gives corners up by Esc, or by turning the view', async () => {
    const [x, y] = await hand.onScreen(mug);
    await page.keyboard.press('s');
    await id('select-tool-lasso').click();
    for (const giveUp of ['Escape', 'ArrowLeft']) {
      await click([x - 70, y - 70], [x + 70, y - 70]);
      await id('sketch').and(page.locator('[d]')).waitFor({ state: 'attached' });
      await page.keyboard.press(giveUp);
      await id('sketch').and(page.locator('[d]')).waitFor({ state: 'detached' });
    }
    assert.deepEqual(await steps(), []);
    assert.equal(await id('hand-select').getAttribute('aria-pressed'), 'true');
  });
});

describe('shapes', () => {
  /// The selection that is asked for when something is done: the first that `is` what is waited for. Answers to what was
  /// done before may still be on their way.
  const asked = async (act, is = () => true) => {
    const selectionOf = (response) => response.request().postDataJSON().selection;
    const [response] = await Promise.all([page.waitForResponse((r) => r.url().endsWith('/select') && is(selectionOf(r))), act()]);
    return selectionOf(response);
  };
  const settled = () => page.waitForFunction(() => {
    const { count, waits } = document.querySelector('[data-testid=selection-count]').dataset;
    return count !== undefined && waits === undefined;
  });

  test('a sphere is drawn out, made larger by its dot, and moved by the gizmo', async () => {
    await page.keyboard.press('s');
    await page.keyboard.press('5');
    const at = await hand.onScreen(mug);
    const [{ sphere }] = await asked(() => hand.drag(at, [at[0] + 50, at[1]]));
    assert.ok(Math.hypot(...sphere.center.map((x, i) => x - mug[i])) < 0.3, `${sphere.center}`);
    const few = await hand.count();
    const dot = await middle('shape-radius-dot');
    await hand.drag(dot, [dot[0], dot[1] - 40]);
    await settled();
    const radius = Number(await id('shape-radius').inputValue());
    assert.ok(radius > 1.4 * sphere.radius, `${radius} was ${sphere.radius}`);
    assert.ok(await hand.count() > few);
    await hand.shot('hands-sphere');
    await id('gizmo-move-x').focus();
    const [{ sphere: moved }] = await asked(() => page.keyboard.press('ArrowLeft'), ([step]) => step.sphere.center[0] !== sphere.center[0]);
    assert.ok(moved.center[0] < sphere.center[0] && moved.center[1] === sphere.center[1]);
    await page.keyboard.press('Control+z');
    await page.keyboard.press('Control+z');
    assert.equal(Number(await id('shape-radius').inputValue()).toFixed(4), sphere.radius.toFixed(4), 'a drag is one step');
  });

  test('a box has faces to pull and numbers, and is turned', async () => {
    await page.keyboard.press('s');
    await page.keyboard.press('6');
    const at = await hand.onScreen(mug);
    const [{ box }] = await asked(() => hand.drag(at, [at[0] + 60, at[1]]));
    const face = await middle('shape-minus-x');
    await hand.drag(face, [face[0] - 100, face[1]]);
    await settled();
    const [width, height] = await numbers('shape-size');
    assert.ok(width > box.size[0] + 0.1 && Math.abs(height - box.size[1]) < 1e-3, `${[width, height]}, was ${box.size}`);
    await id('shape-minus-y').focus();
    await page.keyboard.press('ArrowUp');
    await id('shape-turn-y').fill('30');
    const last = await asked(() => id('shape-turn-y').blur(), (steps) => steps.at(-1).box.rotation !== undefined);
    assert.ok(Math.abs(last.at(-1).box.rotation[2] - Math.sin(Math.PI / 12)) < 1e-9);
    assert.ok(last.at(-1).box.size[1] > box.size[1]);
    await settled();
    await hand.shot('hands-box');
    await id('clear-selection').click();
  });
});
