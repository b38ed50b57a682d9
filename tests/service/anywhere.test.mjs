// Click, drag, done on real scenes: a capture with its cameras, and scenes that came without any.
import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import { onTheWire } from '../../web/camera.js';
import { handOn, launch, openPage } from './support/browser.mjs';
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

const capture = fox();
const things = [
  { name: 'the head of the fox', scene: { absent: capture.absent, bytes: capture.ply, folder: capture.folder }, on: [2.2055, -1.3692, 1.6048], most: 0.35 },
  { name: 'a hand of the robot, whose scene has no cameras', scene: single('playbot/playbot_31k.ply'), on: [-0.404, -0.5908, -0.1174], most: 0.05 },
  { name: "the biker's helmet, whose scene has no cameras", scene: single('biker.spz'), on: [-0.3782, -1.1879, 0.1478], most: 0.2 },
];

const pick = async (scene, version, camera, x, y) =>
  (await service.client.post(`/v1/scenes/${scene}/versions/${version}/pick`, { camera: onTheWire(camera), x, y })).json();

describe('clicked, dragged and let go', () => {
  for (const { name, scene, on, most } of things)
    test(`${name} is where it should be, repaired, in one version more`, { skip: scene.absent ?? false }, async () => {
      const { id: scene_id, gaussians } = await service.client.upload(scene.bytes, { name });
      if (scene.folder) await service.client.putDataset(scene_id, await datasetZip(scene.folder));
      const { page, id, complaints } = await openPage(browser, service, { viewport: { width: 1366, height: 768 } });
      const hand = handOn({ page, id });
      await id(`scene-${scene_id}`).getByTestId('scene-open').click();
      await hand.shown(0);
      const at = await hand.onScreen(on);
      await page.mouse.click(...at);
      const count = await hand.count();
      assert.ok(count > 100 && count < most * gaussians, `${count} of ${gaussians} Gaussians`);
      await hand.drag(at, [at[0] - 60, at[1]]);
      await hand.state('done', patience);
      await hand.shown(1);
      await hand.shot(`anywhere-${name.split(' ').at(-1)}`);
      const [edit] = (await service.client.get(`/v1/edits?scene=${scene_id}`)).json().edits;
      assert.deepEqual([edit.state, edit.request.preset, edit.result_version], ['succeeded', 'draft', 1]);
      assert.ok(edit.handles[0].gaussians >= count, 'all of it, and its crumbs');
      // Where it was let go, that is what is seen now.
      const { camera, box } = await hand.looksFrom();
      const { target } = edit.request.handles[0];
      const { hit, point } = await pick(scene_id, 1, camera, at[0] - 60 - box.x, at[1] - box.y);
      const apart = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
      assert.ok(hit && apart(point, target) < 0.03 * apart(camera.eye, target), `${point} is seen, and not ${target}`);
      assert.deepEqual(complaints, []);
      await page.context().close();
    });
});
