// Makes the README's pictures of the page, from the demo scene: docs/images/page.png, a thing that is taken, and
// docs/images/drag.webp, a drag from click to repair.
//
//   node tests/service/readme_pictures.mjs        (needs img2webp of the Debian package webp)
import { execFileSync } from 'node:child_process';
import path from 'node:path';
import { handOn, launch, openPage } from './support/browser.mjs';
import { root, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, demoScene } from './support/scenes.mjs';

const ball = [-0.28, -0.21, -0.62];
const images = path.join(root, 'docs/images');
const folder = temporaryFolder();
const demo = await demoScene({ gaussians: 150_000, views: 40, size: '640x480', photos: false });
const service = await Service.start();
const browser = await launch();
try {
  const scene = await service.client.upload(demo.ply, { name: 'demo' });
  await service.client.putDataset(scene.id, await datasetZip(demo.folder));
  const { page, id } = await openPage(browser, service, { viewport: { width: 1280, height: 760 }, reducedMotion: 'reduce' });
  const hand = handOn({ page, id });
  await id(`scene-${scene.id}`).getByTestId('scene-open').click();
  await hand.shown(0);
  // Browsers without a screen have no pointer to be seen.
  await page.evaluate(() => {
    const pointer = Object.assign(document.createElement('div'), { id: 'pointer' });
    pointer.style = 'position: fixed; z-index: 99; width: 22px; height: 22px; margin: -11px; border-radius: 50%; border: 3px solid #fff; box-shadow: 0 0 0 1.5px #000, inset 0 0 0 1.5px #000; pointer-events: none; left: -50px; top: 0';
    document.body.append(pointer);
    addEventListener('pointermove', ({ clientX, clientY }) => Object.assign(pointer.style, { left: `${clientX}px`, top: `${clientY}px` }), true);
  });

  const frames = [];
  /// A frame of the animation, shown for so many ms.
  const frame = async (ms) => {
    const file = path.join(folder, `${frames.length}.png`);
    await id('view').screenshot({ path: file });
    frames.push({ file, ms });
  };
  /// Until the picture shows a preview in full that was not there before.
  const previewAfter = (last) => page.waitForFunction((before) => {
    const { version, quality } = document.querySelector('[data-testid=view]').dataset;
    return /^p\d/.test(version) && version !== before && quality === 'full' && version;
  }, last).then((shown) => shown.jsonValue());

  const [x, y] = await hand.onScreen(ball);
  await page.mouse.move(x - 140, y - 90);
  await frame(900);
  await page.mouse.move(x, y, { steps: 4 });
  await frame(500);
  await page.mouse.click(x, y);
  await hand.count();
  await frame(1200);
  await page.screenshot({ path: path.join(images, 'page.png') });
  await page.mouse.down();
  let shown = null;
  for (let step = 1; step <= 8; ++step) {
    await page.mouse.move(x + 20 * step, y, { steps: 3 });
    shown = await previewAfter(shown);
    await frame(step === 8 ? 700 : 120);
  }
  await page.mouse.up();
  await hand.state('repairing');
  await page.waitForTimeout(800);
  await frame(1200);
  await hand.state('done');
  await hand.shown(1);
  await page.mouse.move(x - 140, y - 90);
  await frame(2500);
  execFileSync('img2webp', ['-loop', '0', '-lossy', '-q', '60', ...frames.flatMap(({ file, ms }) => ['-d', `${ms}`, file]), '-o', path.join(images, 'drag.webp')]);
} finally {
  await browser.close();
  await service.stop();
}
