// A page with the demo scene open in it, for tests of what comes after a drag; and rules for access that each state of a page keeps.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { handOn, launch, openPage, patience } from './browser.mjs';
import { Service } from './program.mjs';
import { datasetZip, demoScene } from './scenes.mjs';

const axeSource = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

/// What axe-core finds against WCAG 2.2 A and AA in the state that a page is in: [rule: elements].
export const violations = async (page) => {
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(axeSource);
  const found = await page.evaluate(() => window.axe.run(document, {
    runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa'], resultTypes: ['violations'],
  }));
  return found.violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target).join(', ')}`);
};
/// What can be pressed and is smaller than 24 pixels, or not to be reached: outside of the page's width.
export const tooSmall = (page) => page.evaluate(() => [...document.querySelectorAll('button, a[href], select, input:not([type=file]), summary')]
  .filter((element) => element.checkVisibility() && !element.closest('label'))
  .map((element) => ({ element, box: element.getBoundingClientRect() }))
  .filter(({ box }) => box.width > 0 && (box.height < 24 || box.width < 24 || box.right > innerWidth + 1))
  .map(({ element, box }) => `${element.dataset.testid ?? element.outerHTML.slice(0, 80)}: ${box.width}x${box.height} at ${box.left}`));

/// What lies over the page's edges, so that it would have to be scrolled sideways; and what covers something else that can be
/// pressed, on the picture or beside it.
export const outOfSight = (page) => page.evaluate(() => {
  const found = document.body.innerText.includes('[object') ? ['an object stands for words'] : [];
  if (document.documentElement.scrollWidth > innerWidth) found.push(`the page is ${document.documentElement.scrollWidth} wide`);
  if (document.querySelector('dialog[open]')) return found;
  const name = (element) => element.dataset?.testid ?? element.outerHTML.slice(0, 60);
  const what = document.querySelector('.menu[open]') ? '.menu[open] button' : '#top :is(a, button), #toolbar :is(button, select), #tools :is(button, select), #tabs button, #chips button, #view-tools button, #view-tools summary, #thing-bar button, #notes summary';
  for (const element of document.querySelectorAll(what)) {
    if (!element.checkVisibility()) continue;
    const { left, top, width, height } = element.getBoundingClientRect();
    const on = document.elementFromPoint(left + width / 2, top + height / 2);
    if (!on || !element.contains(on)) found.push(`${name(element)} lies under ${on ? name(on) : 'nothing that is seen'}`);
  }
  return found;
});

/// The middle of the demo scene's ball, world units.
export const ball = [-0.28, -0.21, -0.62];

/// A browser, and a small demo scene with photos: {browser, demo, zip}. `close()` ends it.
export const makeRoom = async ({ gaussians = 20_000 } = {}) => {
  const [browser, demo] = await Promise.all([launch(), demoScene({ gaussians, views: 16, size: '400x300' })]);
  return { browser, demo, zip: await datasetZip(demo.folder), close: () => browser.close() };
};

/// A service with the demo scene and its cameras: {room, service, client, scene}.
export const makeDesk = async (room) => {
  const service = await Service.start();
  const scene = await service.client.upload(room.demo.ply, { name: 'desk' });
  await service.client.putDataset(scene.id, room.zip);
  return { room, service, client: service.client, scene: scene.id };
};

/// The page of its scene, open: as openPage(), and `hand`.
export const openDesk = async ({ room, service, scene }, options = {}) => {
  const made = await openPage(room.browser, service, { reducedMotion: 'reduce', ...options });
  await made.id(`scene-${scene}`).getByTestId('scene-open').click();
  await made.page.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.quality === 'full', null, { timeout: patience });
  return { ...made, hand: handOn(made) };
};

/// The ball put elsewhere by an edit, or back again: the version that has it there.
export const ballMoved = async ({ room, client, scene }, { version = 0, back = false } = {}) => {
  const [{ source, target, radius }] = room.demo.ball.handles;
  const handles = [back ? { source: target, target: source, radius } : { source, target, radius }];
  const { id } = await client.submit({ ...room.demo.ball, handles, scene, version });
  return (await client.succeeded(id)).result_version;
};

/// Until two versions are compared in one picture.
export const compared = (page, way) => page.waitForFunction((wanted) => document.querySelector('[data-testid=view]').dataset.compared === wanted, way);
