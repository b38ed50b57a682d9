// Click, drag, done: a newcomer's first minutes, in a real browser, and what comes of them.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { fingerOn, handOn, launch, openPage } from './support/browser.mjs';
import { run, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

let browser;
before(async () => {
  browser = await launch();
});
after(() => browser?.close());

/// Where things of the demo scene are, world units.
const ball = { middle: [-0.28, -0.21, -0.62], radius: 0.21 };
const add = (a, b) => a.map((x, i) => x + b[i]);
const sub = (a, b) => a.map((x, i) => x - b[i]);

/// How near two versions look through some views, in dB, within the discs that a ball fills where it is and elsewhere:
/// [dB for each middle]. Decoded where decoders are: in the page.
const nearness = (page, versions, views, middles) => page.evaluate(async ({ versions, views, middles, radius }) => {
  const pixels = async ({ scene, version }, view) => {
    const response = await fetch(`/v1/scenes/${scene}/versions/${version}/render?view=${view.name}&format=png`);
    const picture = await createImageBitmap(await response.blob(), { colorSpaceConversion: 'none' });
    const canvas = new OffscreenCanvas(picture.width, picture.height);
    const context = canvas.getContext('2d');
    context.drawImage(picture, 0, 0);
    return context.getImageData(0, 0, picture.width, picture.height);
  };
  const sums = middles.map(() => ({ error: 0, n: 0 }));
  for (const view of views) {
    const [a, b] = [await pixels(versions[0], view), await pixels(versions[1], view)];
    middles.forEach((middle, i) => {
      const [x, y, z] = view.cam_from_world.map((row) => row[0] * middle[0] + row[1] * middle[1] + row[2] * middle[2] + row[3]);
      const scale = a.width / view.width;
      const [u, v, r] = [scale * (view.fx * x / z + view.cx), scale * (view.fy * y / z + view.cy), scale * view.fx * radius / z];
      for (let py = 0; py < a.height; ++py)
        for (let px = 0; px < a.width; ++px) {
          if ((px + 0.5 - u) ** 2 + (py + 0.5 - v) ** 2 > r * r) continue;
          for (let c = 0; c < 3; ++c) sums[i].error += ((a.data[4 * (py * a.width + px) + c] - b.data[4 * (py * a.width + px) + c]) / 255) ** 2;
          sums[i].n += 3;
        }
    });
  }
  return sums.map(({ error, n }) => -10 * Math.log10(error / n));
}, { versions, views, middles, radius: ball.radius });

describe('the first drag of a newcomer', () => {
  const options = { gaussians: 150_000, views: 40, size: '640x480' };
  let demo, service, page, id, complaints, hand;
  before(async () => {
    demo = await demoScene({ ...options, photos: false });
    service = await Service.start();
    ({ page, id, complaints } = await openPage(browser, service, { viewport: { width: 1366, height: 768 } }));
    hand = handOn({ page, id });
  });
  after(async () => {
    await page?.context().close();
    await service?.stop();
  });

  let shift, scene;
  test('drops a splat file, clicks the ball, drags it, lets go: it is there, repaired', async () => {
    await id('scene-file').setInputFiles(path.join(demo.folder, 'scene.ply'));
    await id('workspace').waitFor();
    await hand.shown(0);
    await hand.shot('opened');
    const from = await hand.onScreen(ball.middle);
    await page.mouse.click(...from);
    await hand.state('taken');
    const count = await hand.count();
    assert.ok(count > 3900 && count < 4400, `${count} of the ball's 4,237 are taken`);
    await hand.shot('taken');
    const box = await id('view').boundingBox();
    await hand.drag(from, [from[0] + 0.2 * box.width, from[1]], { drop: false });
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    await hand.shot('dragging');
    await page.mouse.up();
    await hand.state('repairing');
    await hand.shot('repairing');
    await hand.state('done');
    await hand.shown(1);
    await hand.shot('done');
    [scene] = (await service.client.get('/v1/scenes')).json().scenes;
    const [edit] = (await service.client.get('/v1/edits')).json().edits;
    assert.deepEqual([edit.state, edit.request.preset, edit.handles[0].gaussians], ['succeeded', 'draft', count]);
    const [handle] = edit.request.handles;
    shift = sub(handle.target, handle.source);
    assert.ok(Math.hypot(...shift) > 2 * ball.radius + 0.03, `by ${shift}: clear of where it was`);
  });

  /// How the ball of a version looks, in dB, where it was and where it arrived, against the true result.
  let nearTruth;
  test('and it looks as if the ball had always been there', async () => {
    const truth = path.join(temporaryFolder(), 'truth');
    const alike = Object.entries(options).flatMap(([name, value]) => [`--${name}`, value]);
    await run('demo-scene', '--out', truth, ...alike, '--ball-shift', shift.join());
    const known = await service.client.upload(await readFile(path.join(truth, 'scene.ply')), { name: 'truth' });
    await service.client.putDataset(scene.id, await datasetZip(demo.folder));
    await service.client.putDataset(known.id, await datasetZip(demo.folder));
    const { views } = (await service.client.get(`/v1/scenes/${scene.id}/views`)).json();
    const some = views.filter((_, i) => i % 8 === 0);
    const places = [ball.middle, add(ball.middle, shift)];
    const there = { scene: known.id, version: 0 };
    nearTruth = (version) => nearness(page, [{ scene: scene.id, version }, there], some, places);
    const [was, arrived] = await nearTruth(1);
    const [hole, before] = await nearTruth(0);
    console.log(`where the ball was ${was.toFixed(1)} dB (before: ${hole.toFixed(1)}), where it arrived ${arrived.toFixed(1)} dB (${before.toFixed(1)})`);
    assert.ok(arrived >= 30, `where it arrived: ${arrived.toFixed(1)} dB`);
    assert.ok(was >= 27, `where it was, as a draft: ${was.toFixed(1)} dB`);
  });

  test('run well it is a version of its own, which is downloaded', async () => {
    await id('thing-better').click();
    await page.waitForFunction(() => {
      const view = document.querySelector('[data-testid=view]');
      return view.dataset.version === '2' && view.dataset.quality === 'full';
    }, undefined, { timeout: 240_000 });
    const [was, arrived] = await nearTruth(2);
    console.log(`run well: where the ball was ${was.toFixed(1)} dB, where it arrived ${arrived.toFixed(1)} dB`);
    assert.ok(arrived >= 30, `where it arrived: ${arrived.toFixed(1)} dB`);
    assert.ok(was >= 28, `where it was: ${was.toFixed(1)} dB`);
    await id('tab-button-scene').click();
    const [download] = await Promise.all([page.waitForEvent('download'), id('download-2-ply').click()]);
    const bytes = await readFile(await download.path());
    const { versions } = (await service.client.get(`/v1/scenes/${scene.id}`)).json();
    const { gaussians } = versions.find(({ version }) => version === 2);
    assert.match(bytes.subarray(0, 200).toString('latin1'), new RegExp(`^ply\\n[^]*element vertex ${gaussians}\\n`));
    await id('version-1').waitFor({ state: 'detached' });  // the draft has done its work
  });

  test('undo brings back the version and what was dragged on it, at once', async () => {
    await page.keyboard.press('Control+z');
    await hand.state('moved');
    assert.equal(await id('version-select').inputValue(), '0');
    await id('handle-0').waitFor();
    await page.keyboard.press('Control+z');
    await hand.state('taken');
    assert.equal(await id('handle-0').count(), 0);
    await page.keyboard.press('Control+Shift+z');
    await page.keyboard.press('Control+Shift+z');
    await hand.shown(2);
    assert.equal(await id('handle-0').count(), 0, 'no old handle on the new version');
  });

  test('raised no error that only the console shows, and asked nobody else', () => assert.deepEqual(complaints, []));
});

describe('a thing of a small scene', () => {
  const mug = [1.3, -0.16, -0.6];
  let demo, service;
  const opened = async (options) => {
    // Without transitions: colours that are on their way have no contrast to be judged.
    const made = await openPage(browser, service, { reducedMotion: 'reduce', ...options });
    const [scene] = (await service.client.get('/v1/scenes')).json().scenes;
    await made.id(`scene-${scene.id}`).getByTestId('scene-open').click();
    const hand = handOn(made);
    await hand.shown(0);
    return { ...made, hand };
  };
  before(async () => {
    demo = await demoScene({ gaussians: 20_000, views: 24, size: '800x600', photos: false });
    service = await Service.start();
    const scene = await service.client.upload(demo.ply, { name: 'desk' });
    await service.client.putDataset(scene.id, await datasetZip(demo.folder));
  });
  after(() => service?.stop());

  test('is made more and less of, let go, and moved by keys alone', async () => {
    const { page, id, hand, complaints } = await opened();
    const at = await hand.onScreen(mug);
    await page.mouse.click(...at);
    const whole = await hand.count();
    const other = async (than) => {
      await page.waitForFunction((n) => document.querySelector('[data-testid=selection-count]').dataset.count !== String(n), than);
      return hand.count();
    };
    await id('thing-less').click();
    const less = await other(whole);
    assert.ok(less < whole, `${less} of ${whole}`);
    await page.keyboard.press('.');
    assert.equal(await other(less), whole);
    await page.keyboard.press('Control+z');
    assert.equal(await other(whole), less, 'each step can be undone');
    await page.keyboard.press('Escape');
    await id('thing-bar').waitFor({ state: 'hidden' });
    await id('hint').waitFor();
    await page.mouse.click(...at);
    await hand.count();
    // Within the time of a double click, but with a key in between: each click is one of its own.
    await page.mouse.click(...at);
    await page.keyboard.press('Escape');
    await page.mouse.click(...at);
    await hand.count();
    await id('thing-hold').click();
    await page.waitForFunction(() => document.activeElement.dataset.testid === 'handle-0-target');
    for (let i = 0; i < 5; ++i) await page.keyboard.press('ArrowLeft');
    await hand.state('moved');
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    await id('thing-drop').click();
    await hand.shown(0);
    assert.deepEqual(complaints, []);
    await page.context().close();
  });

  test('is left as it was let go, unrepaired, for who wants it so', async () => {
    // In a large window pictures at rest are larger than any while something moves.
    const { page, id, hand } = await opened({ viewport: { width: 1920, height: 1080 } });
    await id('auto-repair').uncheck();
    const at = await hand.onScreen(mug);
    await page.mouse.click(...at);
    await hand.count();
    const pictures = [];  // of previews, in the order in which they are asked for
    page.on('request', (request) => {
      const [, version] = /versions\/(p\d+)\/render$/.exec(request.url()) ?? [];
      if (version) pictures.push({ version, width: request.postDataJSON().camera.width });
    });
    await hand.drag(at, [at[0] - 60, at[1]], { drop: false });
    for (let i = 0; i < 40; ++i) {
      await page.mouse.move(at[0] - 60 - i, at[1]);
      await page.waitForTimeout(20);
    }
    await page.waitForFunction(() => document.querySelector('[data-testid=view]').dataset.quality === 'full');
    const widest = Math.max(...pictures.map(({ width }) => width));
    assert.equal(pictures.at(-1).width, widest, 'where it rests, all of it is shown, before it is let go');
    const onTheWay = pictures.slice(0, -2);
    const wide = onTheWay.filter(({ width }) => width === widest).length;
    assert.ok(onTheWay.length > 5 && wide < onTheWay.length / 4, `${wide} of ${onTheWay.length} on the way take the time of the next`);
    await page.mouse.up();
    await hand.state('moved');
    await id('thing-repair').waitFor();
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    assert.deepEqual((await service.client.get('/v1/edits')).json().edits, [], 'nobody has asked for an edit');
    await page.waitForTimeout(600);  // it saves a little later
    await page.reload();
    // What was saved is put back once the scene is there.
    await page.waitForFunction(() => document.querySelector('[data-testid=auto-repair]')?.checked === false);
    await page.context().close();
  });

  test('is removed by one press, which can be undone', async () => {
    const { page, id, hand, complaints } = await opened();
    await page.mouse.click(...await hand.onScreen(mug));
    const count = await hand.count();
    await id('thing-remove').click();
    await hand.state('repairing');
    await hand.state('done');
    const [edit] = (await service.client.get('/v1/edits')).json().edits;
    assert.deepEqual([edit.request.mode, edit.request.handles, edit.gaussians.removed >= count], ['remove', [], true]);
    await hand.shown(edit.result_version);
    await hand.shot('removed');
    await id('thing-undo').click();
    await hand.shown(0);
    assert.equal(await hand.count(), count, 'it is there and taken, as before');
    await service.client.delete(`/v1/scenes/${edit.scene}/versions/${edit.result_version}`);
    assert.deepEqual(complaints, []);
    await page.context().close();
  });

  test('a preview that nobody kept is not how the scene is remembered', async () => {
    const { page, id, hand } = await opened();
    const remembered = () => page.evaluate(() => JSON.parse(localStorage.getItem(Object.keys(localStorage).find((key) => key.startsWith('splatdrag.scene.')))).thumbnail);
    await page.waitForFunction(() => Object.values(localStorage).some((text) => text.includes('thumbnail')));
    const before = await remembered();
    await page.mouse.click(...await hand.onScreen(mug));
    await hand.count();
    await id('thing-hold').click();
    await id('handle-0-target').focus();
    for (let i = 0; i < 8; ++i) await page.keyboard.press('ArrowUp');
    await page.waitForFunction(() => {
      const view = document.querySelector('[data-testid=view]');
      return /^p\d/.test(view.dataset.version) && view.dataset.quality === 'full';
    });
    await page.waitForTimeout(2200);  // a picture that stays is remembered after 1.5 s
    assert.equal(await remembered(), before);
    await page.context().close();
  });

  test('single letters are no keys for who has turned them off', async () => {
    const { page, id } = await opened();
    const hand = (name) => id(`hand-${name}`).getAttribute('aria-pressed');
    await page.keyboard.press('h');
    assert.equal(await hand('handle'), 'true');
    await page.keyboard.press('?');
    await id('letter-keys').uncheck();
    await page.keyboard.press('Escape');
    await page.keyboard.press('d');
    assert.equal(await hand('handle'), 'true');
    await page.reload();
    await id('hand-handle').waitFor();
    await page.keyboard.press('s');
    assert.equal(await hand('handle'), 'true', 'after a reload, too');
    await page.context().close();
  });

  test('a double click turns the view about what is there, and the wheel keeps it where it is', async () => {
    const { page, hand } = await opened();
    const at = await hand.onScreen(mug);
    await page.mouse.dblclick(...at);
    await page.waitForFunction(() => document.querySelector('[data-testid=view-select]').value === '');
    await hand.shown(0);
    const box = await page.getByTestId('view').boundingBox();
    const there = await hand.onScreen(mug);
    const away = Math.hypot(there[0] - box.x - box.width / 2, there[1] - box.y - box.height / 2);
    assert.ok(away < 60, `the mug is ${away} pixels from the middle`);
    const corner = [box.x + 0.2 * box.width, box.y + 0.8 * box.height];
    await page.mouse.move(...corner);
    await page.mouse.wheel(0, -300);
    const after = await hand.onScreen(mug);
    const factor = Math.hypot(after[0] - corner[0], after[1] - corner[1]) / Math.hypot(there[0] - corner[0], there[1] - corner[1]);
    assert.ok(factor > 1.2 && factor < 2, `all moves away from the pointer: ${factor}`);
    await page.context().close();
  });

  test('is taken by a tap and moved by a finger', async () => {
    const { page, id, hand, complaints } = await opened({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
    const at = await hand.onScreen(mug);
    await page.touchscreen.tap(...at);
    const count = await hand.count();
    const finger = await fingerOn(page);
    await finger.drag(at, ...[1, 2, 3, 4, 5, 6, 7, 8].map((i) => [at[0] - 8 * i, at[1]]), { drop: false });
    await page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
    await finger.drop();
    await hand.state('done');
    const [edit] = (await service.client.get('/v1/edits')).json().edits;
    await hand.shown(edit.result_version);
    await hand.shot('phone-done');
    assert.equal(edit.handles[0].gaussians, count);
    assert.deepEqual(complaints, []);
    await page.context().close();
  });
});
