// Rules for access (WCAG 2.2, A and AA) and for what a hand can hit, in each state of the page, on each size of screen.
import assert from 'node:assert/strict';
import { writeFile } from 'node:fs/promises';
import path from 'node:path';
import { after, before, describe, test } from 'node:test';
import { fingerOn, handOn, openPage } from './support/browser.mjs';
import { ball, ballMoved, compared, makeRoom, outOfSight, tooSmall, violations } from './support/desk.mjs';
import { root, Service, temporaryFolder } from './support/program.mjs';

const touch = { hasTouch: true, isMobile: true };
const screens = {
  desk: { viewport: { width: 1366, height: 768 } },
  large: { viewport: { width: 1920, height: 1080 } },
  tablet: { viewport: { width: 820, height: 1180 }, ...touch },
  phone: { viewport: { width: 390, height: 844 }, ...touch },
  'phone-on-its-side': { viewport: { width: 844, height: 390 }, ...touch },
};
const token = 'a-token-that-nobody-guesses';

let room, service;
before(async () => {
  room = await makeRoom({ gaussians: 6000 });
  const file = path.join(temporaryFolder(), 'token');
  await writeFile(file, token, { mode: 0o600 });
  service = await Service.start({ args: ['--token-file', file, '--edit-attempts', '1'], token });
});
after(async () => {
  await room?.close();
  await service?.stop();
});

/// An open page, signed in or not, and `check(state)`: the rules, and a picture of it for who looks.
const opened = async (name) => {
  // Without transitions: colours that are on their way have no contrast to be judged.
  const made = await openPage(room.browser, service, { reducedMotion: 'reduce', ...screens[name] });
  const hand = handOn(made);
  let n = 0;
  const check = async (state) => {
    await hand.shot(`${name}-${String(n++).padStart(2, '0')}-${state}`);
    const found = { violations: await violations(made.page), tooSmall: await tooSmall(made.page), outOfSight: await outOfSight(made.page) };
    assert.deepEqual(found, { violations: [], tooSmall: [], outOfSight: [] }, `${name}, ${state}`);
  };
  return { ...made, hand, check };
};

describe('before there is a scene', () => {
  for (const name of Object.keys(screens))
    test(`on a ${name}`, async () => {
      const { page, id, check, complaints } = await opened(name);
      await id('sign-in').waitFor();
      await check('sign-in');
      await id('token').fill('wrong');
      await id('token-submit').click();
      await id('token-problem').getByText('token').waitFor();
      await check('wrong-token');
      await id('token').fill(token);
      await id('token-submit').click();
      await id('no-scenes').waitFor();
      await check('home-empty');
      await id('scene-file').setInputFiles({ name: 'chair.ply', mimeType: 'application/octet-stream', buffer: Buffer.from('ply, but not really') });
      await id('upload-problem').waitFor();
      await check('upload-refused');
      assert.deepEqual(complaints.filter((text) => !/status of 422/.test(text)), []);
      await page.context().close();
    });
});

describe('with a scene', () => {
  let desk, failed;
  before(async () => {
    const { client } = service;
    const scene = await client.upload(room.demo.ply, { name: 'desk' });
    await client.putDataset(scene.id, room.zip);
    desk = { room, service, client, scene: scene.id };
    assert.equal(await ballMoved(desk), 1);
    // One that the service died of, and that is not tried again.
    failed = (await client.submit({ ...room.demo.ball, scene: scene.id, version: 0, preset: 'standard', params: { intervals: 20 } })).id;
    await client.until(failed, ({ state }) => state === 'running');
    await service.kill();
    await service.start({ there: true });
    desk.client = service.client;
    assert.equal((await service.client.ended(failed)).state, 'failed');
  });

  /// As it was, for the screen that comes next, whatever has happened on this one.
  const cleared = async () => {
    service.process.kill('SIGCONT');
    const { client } = service;
    const isOurs = (edit) => edit.id === failed || edit.result_version === 1;
    const edits = async () => (await client.get('/v1/edits')).json().edits.filter((edit) => !isOurs(edit));
    for (const { id, ended } of await edits())
      if (!ended) {
        await client.post(`/v1/edits/${id}/cancel`, undefined, { expect: [200, 409] }); // it may end just now
        await client.ended(id);
      }
    for (const { version } of (await client.get(`/v1/scenes/${desk.scene}`)).json().versions)
      if (version > 1) await client.delete(`/v1/scenes/${desk.scene}/versions/${version}`);
    for (const { id } of await edits()) await client.delete(`/v1/edits/${id}`);
  };

  for (const [name, options] of Object.entries(screens))
    test(`on a ${name}`, async (t) => {
      const { page, id, hand, check, complaints } = await opened(name);
      t.after(async () => {
        await page.context().close();
        await cleared();
      });
      const finger = options.hasTouch ? await fingerOn(page) : null;
      const press = (testid) => (finger ? id(testid).tap() : id(testid).click());
      const pressAt = (place) => (finger ? page.touchscreen.tap(...place) : page.mouse.click(...place));
      const previewed = () => page.waitForFunction(() => /^p\d/.test(document.querySelector('[data-testid=view]').dataset.version));
      const isSheet = name === 'tablet' || name === 'phone';
      const tab = async (one) => {
        await press(`tab-button-${one}`);
        await id(`tab-${one}`).waitFor();
      };
      const folded = async () => isSheet && (await id('fold').getAttribute('aria-expanded')) === 'true' && press('fold');

      await id('token').fill(token);
      await id('token-submit').click();
      await id(`scene-${desk.scene}`).waitFor();
      await check('home');
      await id(`scene-${desk.scene}`).getByTestId('scene-open').click();
      await hand.shown(1);
      await check('loaded');
      assert.deepEqual(await page.locator('h1:visible').allTextContents(), ['desk']);
      for (const menu of ['up-menu', 'turn-menu']) {
        await press(menu);
        await check(menu);
        await page.keyboard.press('Escape');
      }
      await press('help-button');
      await check('help');
      const keys = await id('help').locator('dt').allTextContents();
      if (finger) assert.doesNotMatch(keys.join(' '), /\(hold\)|Ctrl|Wheel/, 'what a phone has not');
      else {
        const letters = ['T', 'D, H', 'S', 'E', 'O', 'V, U, L, X, Y, Z, N', 'G, W', 'R', 'B (hold)', 'C', 'P'];
        const others = ['Double click, or F', '. and ,', '1 to 6', '[ and ]', 'Del', 'Ctrl + Z, Ctrl + Shift + Z'];
        assert.deepEqual([...letters, ...others].filter((key) => !keys.includes(key)), [], 'said of keys');
      }
      await page.keyboard.press('Escape');
      await press('fly');
      await check('flying');
      await press('fly');
      await press('photo-toggle');
      await page.waitForFunction(() => document.querySelector('[data-testid=photo]').naturalWidth > 0);
      await check('photo');
      await press('photo-toggle');

      // A result: compared, in the tree of versions, step by step.
      for (const way of ['slider', 'difference', 'blink']) {
        await id('compare-mode').selectOption(way);
        await compared(page, way);
        await check(`compare-${way}`);
      }
      await id('compare-mode').selectOption('');
      await tab('scene');
      await check('versions');
      await press('version-1-name');
      await check('ask');
      await page.keyboard.press('Escape');
      await press('version-1-delete');
      await check('confirm');
      await page.keyboard.press('Escape');
      await tab('edits');
      await id(`edit-${failed}`).and(page.locator('[data-state=failed]')).waitFor();
      await check('failed');
      await press('thumb-1-0');
      await page.waitForFunction(() => document.querySelector('[data-testid=scrub-picture]').naturalWidth > 0);
      await check('steps');
      await page.keyboard.press('Escape');

      // Requests from files: several, and one that is refused.
      await id('version-select').selectOption('0');
      await id('import-file').setInputFiles(path.join(root, 'proto/examples/named_requests.json'));
      await id('choose').waitFor();
      await check('choose');
      await id('choose').getByRole('button').first().click();
      await id('handle-card-0').waitFor();
      await previewed();
      await check('handles');
      await id('settings').locator('summary').click();
      await id('region-on').check();
      await id('region-center-x').fill('50');
      await id('region-center-x').blur();
      await id('notes').getByText('Refused').waitFor();
      await check('refused');
      await press('note-no-region');
      await id('settings').locator('summary').click();
      await press('clear-handles');

      // Selecting, with each tool.
      await folded();
      await press('hand-select');
      await check('selecting');
      const at = await hand.onScreen(ball);
      for (const tool of ['grow', 'brush', 'lasso', 'rectangle', 'sphere', 'box']) {
        await press(`select-tool-${tool}`);
        const before = await id('selection-steps').locator('li').count();
        await pressAt(at);
        // A lasso and a frame have a corner by that, and nothing is selected yet.
        if (tool !== 'lasso' && tool !== 'rectangle') {
          // The count of the step before is there all the while.
          await id('selection-steps').locator('li').nth(before).waitFor({ state: 'attached' });
          await hand.count();
        }
        await check(`tool-${tool}`);
      }
      await tab('drag');
      await press('clear-selection');
      await folded();
      await press('hand-heal');
      await check('healing');

      // A thing: taken, dragged, repaired.
      await press('hand-thing');
      await folded();
      await hand.shown(0);
      const place = await hand.onScreen(ball);
      await pressAt(place);
      await hand.count();
      await check('taken');
      if (isSheet) {
        await press('thing-hold');
        await check('numbers');
        await folded();
      }
      const pull = finger ?? hand.mouse;
      const there = await hand.onScreen(ball);
      await pull.drag(there, [there[0] + 40, there[1]], [there[0] + 60, there[1]], { drop: false });
      await previewed();
      await hand.state('dragging');
      await check('dragging');
      await pull.drop();
      await hand.state('done');
      const made = Number(await id('version-select').inputValue());
      await hand.shown(made);
      await check('done');
      await press('thing-undo');
      await hand.state('moved');
      await tab('drag');
      await id('settings').locator('summary').click();
      await id('param-corrector').selectOption('none');  // that it optimises is to be seen, not how it is corrected before
      await id('param-iterations').fill('4000');
      await id('param-iterations').blur();
      await id('settings').locator('summary').click();
      await press('run');
      const running = page.locator('[data-testid^="edit-e"][data-state=running]');
      await running.getByText('iteration').first().waitFor();
      await check('running');
      await running.getByTestId('edit-cancel').click();
      await check('cancel');
      await press('confirm-yes');
      await page.locator('[data-testid^="edit-e"][data-state=cancelled]').first().waitFor();
      await check('cancelled');

      if (name === 'desk' || name === 'phone') {
        service.process.kill('SIGSTOP');
        await id('away').waitFor();
        await check('away');
        service.process.kill('SIGCONT');
        await id('away').waitFor({ state: 'hidden' });
      }
      assert.deepEqual(complaints.filter((text) => !/status of 422/.test(text)), [], 'but for the refusal that was asked for');
    });
});
