// Click, drag, done: a newcomer's first minutes, in a real browser, and what comes of them.
import assert from 'node:assert/strict';
import { mkdirSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { project } from '../../web/camera.js';
import { launch, openPage, patience } from './support/browser.mjs';
import { run, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const shots = process.env.SPLATDRAG_SHOTS;
if (shots) mkdirSync(shots, { recursive: true });

let browser;
before(async () => { browser = await launch(); });
after(() => browser?.close());

/// Where things of the demo scene are, world units.
const ball = { middle: [-0.28, -0.21, -0.62], radius: 0.21 };
const add = (a, b) => a.map((x, i) => x + b[i]);
const sub = (a, b) => a.map((x, i) => x - b[i]);

/// The hand on the picture of an open page.
const handOn = ({ page, id }) => {
  const state = (wanted) => page.waitForFunction((name) => {
    const bar = document.querySelector('[data-testid=thing-bar]');
    return !bar.hidden && bar.dataset.state === name;
  }, wanted, { timeout: 120_000 });
  return {
    state,
    /// Until the picture on the screen is the full one of a version.
    shown: (version) => page.waitForFunction((wanted) => {
      const view = document.querySelector('[data-testid=view]');
      return view?.dataset.version === String(wanted) && view.dataset.quality === 'full';
    }, version, { timeout: patience }),
    /// Where a point of the world is on the screen, once the page has remembered where it looks from.
    onScreen: async (point) => {
      await page.waitForTimeout(600);  // it saves a little later
      const pose = await page.evaluate(() => {
        const name = Object.keys(localStorage).find((key) => key.startsWith('splatdrag.scene.'));
        return JSON.parse(localStorage.getItem(name)).pose;
      });
      const box = await id('view').boundingBox();
      const { x, y } = project({ ...pose, width: box.width, height: box.height }, point);
      return [box.x + x, box.y + y];
    },
    /// How many Gaussians are taken, once the page knows and the picture shows them.
    count: async () => Number(await (await page.waitForFunction(() => {
      const { count, waits } = document.querySelector('[data-testid=selection-count]').dataset;
      const { selection, quality } = document.querySelector('[data-testid=view]').dataset;
      return count > 0 && waits === undefined && selection && quality === 'full' && count;
    })).jsonValue()),
    drag: async (from, to, { drop = true } = {}) => {
      await page.mouse.move(...from);
      await page.mouse.down();
      await page.mouse.move(...to, { steps: 12 });
      if (drop) await page.mouse.up();
    },
    shot: (name) => shots && page.screenshot({ path: path.join(shots, `${name}.png`) }),
  };
};

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
  let demo, service, page, id, complaints, hand;
  before(async () => {
    demo = await demoScene({ gaussians: 150_000, views: 40, size: '640x480', photos: false });
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
    await hand.drag(from, [from[0] + 0.13 * box.width, from[1]], { drop: false });
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
    assert.ok(Math.hypot(...shift) > 0.3, `by ${shift}`);
  });

  test('and it looks as if the ball had always been there', async () => {
    const truth = path.join(temporaryFolder(), 'truth');
    await run('demo-scene', '--out', truth, '--views', '40', '--ball-shift', shift.join());
    const known = await service.client.upload(await readFile(path.join(truth, 'scene.ply')), { name: 'truth' });
    await service.client.putDataset(scene.id, await datasetZip(demo.folder));
    await service.client.putDataset(known.id, await datasetZip(demo.folder));
    const { views } = (await service.client.get(`/v1/scenes/${scene.id}/views`)).json();
    const some = views.filter((_, i) => i % 8 === 0);
    const places = [ball.middle, add(ball.middle, shift)];
    const [was, arrived] = await nearness(page, [{ scene: scene.id, version: 1 }, { scene: known.id, version: 0 }], some, places);
    const [hole, before] = await nearness(page, [{ scene: scene.id, version: 0 }, { scene: known.id, version: 0 }], some, places);
    console.log(`where the ball was ${was.toFixed(1)} dB (before: ${hole.toFixed(1)}), where it arrived ${arrived.toFixed(1)} dB (${before.toFixed(1)})`);
    assert.ok(arrived >= 30, `where it arrived: ${arrived.toFixed(1)} dB`);
    assert.ok(was >= 28, `where it was: ${was.toFixed(1)} dB`);
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
    await hand.shown(1);
    assert.equal(await id('handle-0').count(), 0, 'no old handle on the new version');
  });

  test('raised no error that only the console shows, and asked nobody else', () => assert.deepEqual(complaints, []));
});
