// Click, drag, done on real scenes: a capture with its cameras, and scenes that came without any; by mouse, fingers and keys.
import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import { onTheWire } from '../../web/camera.js';
import { pictureIn } from '../../web/framing.js';
import { fingerOn, handOn, launch, openPage } from './support/browser.mjs';
import { Service } from './support/program.mjs';
import { datasetZip, fox, single } from './support/scenes.mjs';

const patience = 280_000;  // a draft takes half a minute on two idle cores

let browser, service;
before(async () => {
  browser = await launch();
  service = await Service.start();
});
after(async () => {
  await browser?.close();
  await service?.stop();
});

const byMouse = {
  take: async ({ page, hand }, point) => page.mouse.click(...await hand.onScreen(point)),
  drag: async ({ hand }, point) => {
    const [x, y] = await hand.onScreen(point);
    await hand.drag([x, y], [x - 60, y]);
  },
};
const byFinger = {
  context: { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
  take: async ({ page, hand }, point) => page.touchscreen.tap(...await hand.onScreen(point)),
  drag: async ({ page, hand }, point) => {
    const [x, y] = await hand.onScreen(point);
    await (await fingerOn(page)).drag([x, y], ...[10, 20, 30, 40, 50, 60].map((d) => [x - d, y]));
  },
};
const byKeys = {
  take: async ({ page, hand }, point) => {
    await hand.aim(point);
    await page.keyboard.press('Enter');
  },
  drag: async ({ page, id, hand }) => {
    await id('thing-hold').press('Enter');
    await page.waitForFunction(() => document.activeElement.dataset.testid === 'handle-0-target');
    for (let i = 0; i < 8; ++i) await page.keyboard.press('ArrowLeft');
    await hand.state('moved');
    await id('thing-repair').press('Enter');
  },
};

const capture = fox();
const things = [
  { name: 'the head of the fox', scene: { absent: capture.absent, bytes: capture.ply, folder: capture.folder }, on: [2.2055, -1.3692, 1.6048], most: 0.35, by: byMouse },
  { name: 'a hand of the robot, whose scene has no cameras, by a finger', scene: single('playbot/playbot_31k.ply'), on: [-0.404, -0.5908, -0.1174], most: 0.05, by: byFinger },
  { name: "the biker's helmet, whose scene has no cameras, by keys", scene: single('biker.spz'), on: [-0.3782, -1.1879, 0.1478], most: 0.2, by: byKeys },
  { name: 'the neck of the guitar, whose scene has no cameras', scene: single('guitar.compressed.ply'), on: [-0.5265, -4.1138, 0.1521], most: 0.3, by: byMouse, goesOn: true },
];
const apart = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

const pick = async (scene, version, camera, x, y) =>
  (await service.client.post(`/v1/scenes/${scene}/versions/${version}/pick`, { camera: onTheWire(camera), x, y })).json();

/// What nobody has ever seen behind a thing is said to be made up, and where that is, is marked in the picture of a view.
const isMarked = async ({ page, id, hand }, edit) => {
  const { view, open_box: box } = edit.uncovered.filter(({ open }) => open > 0).sort((a, b) => b.open / b.area - a.open / a.area)[0];
  await id('notes').locator('summary').click();
  await id('notes').getByText(`Made up in ${view}`).waitFor();
  await id('note-look').click();
  await page.waitForFunction((name) => document.querySelector('[data-testid=view-select]').value === name, view);
  await hand.shown(edit.result_version);
  await id('open-mark').waitFor();
  const { views } = (await service.client.get(`/v1/scenes/${edit.scene}/views`)).json();
  const { camera, box: picture } = await hand.looksFrom();
  const whole = pictureIn(camera, views.find(({ name }) => name === view));
  const mark = await id('open-mark').boundingBox();
  const corners = [
    [mark.x - picture.x, whole.x + box[0] * whole.width], [mark.y - picture.y, whole.y + box[1] * whole.height],
    [mark.x - picture.x + mark.width, whole.x + box[2] * whole.width], [mark.y - picture.y + mark.height, whole.y + box[3] * whole.height],
  ];
  for (const [is, should] of corners) assert.ok(Math.abs(is - should) < 1, `${is} and not ${should}`);
  await hand.shot('anywhere-mark');
  await id('notes').locator('summary').click();
  await id('view').focus();
  await page.keyboard.press('ArrowLeft');
  await id('open-mark').waitFor({ state: 'hidden' });
  await id('reset-view').click();
};

describe('clicked, dragged and let go', () => {
  for (const { name, scene, on, most, by, goesOn } of things)
    test(`${name} is where it should be, repaired, in one version more`, { skip: scene.absent ?? false }, async () => {
      const { id: scene_id, gaussians } = await service.client.upload(scene.bytes, { name });
      if (scene.folder) await service.client.putDataset(scene_id, await datasetZip(scene.folder));
      const made = await openPage(browser, service, { viewport: { width: 1366, height: 768 }, ...by.context });
      const { page, id, complaints } = made;
      const hand = handOn(made);
      await id(`scene-${scene_id}`).getByTestId('scene-open').click();
      await hand.shown(0);
      await by.take({ ...made, hand }, on);
      const count = await hand.count();
      assert.ok(count > 100 && count < most * gaussians, `${count} of ${gaussians} Gaussians`);
      await by.drag({ ...made, hand }, on);
      await hand.state('done', patience);
      await hand.shown(1);
      await hand.shot(`anywhere-${name.replace(/\W+/g, '-')}`);
      const [edit] = (await service.client.get(`/v1/edits?scene=${scene_id}`)).json().edits;
      assert.deepEqual([edit.state, edit.request.preset, edit.result_version], ['succeeded', 'draft', 1]);
      assert.ok(edit.handles[0].gaussians >= count, 'all of it, and its crumbs');
      const [{ source, target }] = edit.request.handles;
      /// Where it was let go, that is what is seen now.
      const isThere = async (version) => {
        const { camera, box } = await hand.looksFrom();
        const [x, y] = await hand.onScreen(target);
        const { hit, point } = await pick(scene_id, version, camera, x - box.x, y - box.y);
        assert.ok(hit && apart(point, target) < 0.03 * apart(camera.eye, target), `${point} is seen, and not ${target}`);
      };
      assert.ok(apart(source, on) < 0.2, `${source} was taken hold of`);
      await isThere(1);
      if (goesOn) {
        await id('thing-better').click();
        await isMarked({ ...made, hand }, edit);  // meanwhile
        await page.waitForFunction(() => document.querySelector('[data-testid=view]').dataset.version === '2', null, { timeout: patience });
        const [better] = (await service.client.get(`/v1/edits?scene=${scene_id}`)).json().edits;
        assert.deepEqual([better.state, better.request.preset, better.result_version], ['succeeded', 'standard', 2]);
        await isThere(2);
        await id('version-1').waitFor({ state: 'detached' });  // the draft has done its work
      }
      assert.deepEqual(complaints, []);
      await page.context().close();
    });
});
