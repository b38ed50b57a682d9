// Edit requests of every kind on small scenes, each quick: what the test of the same bytes carries out.
import { movedRequest } from './variants.mjs';

/// Far enough for an edit to work in a frame of its own, near enough for floats to keep half a millimetre.
export const farAway = [4000, -2500, 8000];

// Closing in space what a part has left takes as long for small scenes and pictures as for large ones, and is mostly done
// anew in each correction: corrections are few where one more would show nothing new. All that `paper` has of its
// own are in the edits that extend, which leave nothing.
const small = { views: 6, max_image_side: 96, iterations: 24 };
const finer = { views: 9, max_image_side: 160, iterations: 40 };
// From the strongest correction to none, so that each step differs from the next whatever the rule.
const annealed = { annealing_steps: 3, iterations: 10, strength_initial: 1, strength_final: 0 };
const withParams = (drag, preset, params = {}, more = {}) => ({ ...drag, preset, ...more, params });
const corrected = (drag, preset, params = {}, more = {}) => withParams(drag, preset, { ...small, ...params }, more);
const extend = { mode: 'extend' };

/// As released with 3DGS-Drag.
const released = ({ handles }, more = {}) => ({
  start: handles.map(({ source }) => source),
  direction: handles.map(({ source, target }) => (target ?? source).map((value, axis) => value - source[axis])),
  voxel_size: handles[0].radius, ...more });

/// [{name, scene, dataset, request, pictures?, requestName?, threads?}]
///   ball, leaf  drags of the demo scene: one handle; an anchor and three more
///   scene       "demo", "capture", "far" or "splat"
///   dataset     whether the cameras of the scene are given
///   threads     other numbers of them, which must make no difference
export const editRequests = ({ ball, leaf }) => {
  const both = { mode: 'move', handles: [...ball.handles.map((handle) => ({ ...handle, group: 1 })), ...leaf.handles] };
  const tip = { mode: 'move', handles: leaf.handles.slice(2) };
  const around = { center: ball.handles[0].source, size: [0.5, 0.3, 0.6] };
  // So thin that closing its place takes little, thick enough to leave a hole.
  const rod = { ...ball, region: { center: ball.handles[0].source, size: [0.5, 0.24, 0.24] } };
  const demo = (name, request, more = {}) => ({ name, scene: 'demo', dataset: true, request, ...more });
  const virtual = (name, request, more = {}) => demo(name, request, { dataset: false, ...more });
  const others = { threads: [1, 3] };
  return [
    demo('preset preview', withParams(ball, 'preview'), others),
    demo('preset draft', corrected(ball, 'draft')),
    demo('preset standard', corrected(ball, 'standard', finer), { pictures: 2, ...others }),
    demo('preset paper', corrected(ball, 'paper', { iterations: 8, intervals: 2, annealing_steps: 2 })),
    demo('no preset', { ...leaf, params: { ...small, max_image_side: 128 } }),
    demo('several handles, preview', withParams(leaf, 'preview')),
    demo('several handles, standard', corrected(leaf, 'standard', { intervals: 2 }), others),
    demo('several handles, paper', corrected(leaf, 'paper', { iterations: 6, intervals: 2, annealing_steps: 1 })),
    demo('extend, preview', withParams(ball, 'preview', {}, extend)),
    demo('extend, draft', corrected(leaf, 'draft', {}, extend)),
    demo('extend, standard', corrected(ball, 'standard', { iterations: 12 }, extend), others),
    demo('extend, paper', corrected(leaf, 'paper', { iterations: 6 }, extend)),
    virtual('virtual cameras, preview', withParams(ball, 'preview')),
    virtual('virtual cameras, standard', corrected(leaf, 'standard', { intervals: 1 }), others),
    virtual('virtual cameras, extend', corrected(ball, 'draft', {}, extend)),
    demo('corrector none', corrected(ball, 'standard', { corrector: 'none', strength_initial: 0.9 })),
    demo('corrector scene with a preview', withParams(ball, 'preview', { corrector: 'scene' })),
    demo('corrector scene with iterations', corrected(ball, 'preview', { corrector: 'scene', intervals: 2 })),
    demo('rotation paper', corrected(leaf, 'draft', { rotation: 'paper', intervals: 2 })),
    demo('rotation none', corrected(leaf, 'draft', { rotation: 'none', intervals: 2 })),
    demo('interpolation paper', withParams(leaf, 'preview', { interpolation: 'paper' })),
    demo('interpolation smooth', withParams(leaf, 'preview', { interpolation: 'smooth' })),
    demo('interpolation smooth, rotation paper', corrected(both, 'draft', { interpolation: 'smooth', rotation: 'paper' })),
    demo('interpolation rigid, rotation none', withParams(both, 'preview', { interpolation: 'rigid', rotation: 'none' })),
    demo('rotate_sh off', withParams(leaf, 'preview', { rotate_sh: false })),
    demo('groups and an anchor', corrected(both, 'standard', { intervals: 2 })),
    demo('a region', corrected({ ...ball, region: around }, 'draft')),
    demo('a region, extend', withParams({ ...ball, ...extend, region: around }, 'preview')),
    demo('annealing linear in three steps', corrected(rod, 'draft', { ...annealed, annealing: 'linear' })),
    demo('annealing paper in three steps', corrected(rod, 'draft', { ...annealed, annealing: 'paper' })),
    demo('excluded views', corrected(ball, 'draft', { exclude_views: ['view_00.png', 'view_03.png', 'view_07.png'] })),
    demo('another seed', corrected(ball, 'draft', { seed: 7 })),
    virtual('a large seed', corrected(leaf, 'draft', { seed: 2 ** 52 + 1 })),
    demo('seven intervals', withParams(leaf, 'preview', { intervals: 7 })),
    // With so many iterations that one who looks sees them: it is stopped and killed, too.
    demo('many intervals, corrected', corrected(rod, 'draft', { intervals: 3, iterations: 400 })),
    demo('defaults given in words', corrected(ball, 'draft', { background: 'render', perceptual: 'msssim', rotation: 'shortest_arc', rotate_sh: true })),
    demo('a prompt', corrected(tip, 'draft', {}, { prompt: 'a leaf' })),
    demo('a zero drag', corrected({ mode: 'move', handles: [{ ...ball.handles[0], target: ball.handles[0].source }] }, 'draft')),
    demo('released configuration', released(ball, { mode: 'extend', local_mask: { center: around.center, xyz: around.size } })),
    demo('released configuration with an anchor', { comment: 'bends a leaf', leaf: released(leaf, { cluster: [0, 0, 1, 1] }) }, { requestName: 'leaf' }),
    { name: 'far away, virtual cameras', scene: 'far', dataset: false, request: movedRequest(withParams(leaf, 'preview'), farAway) },
    { name: 'far away, corrected', scene: 'far', dataset: true, request: movedRequest(corrected(ball, 'standard'), farAway), ...others },
    { name: 'far away, extend', scene: 'far', dataset: false, request: movedRequest(corrected(ball, 'draft', {}, extend), farAway) },
    { name: 'a capture, preview', scene: 'capture', dataset: true, request: withParams(leaf, 'preview') },
    { name: 'a capture, rotate_sh off', scene: 'capture', dataset: true, request: withParams(leaf, 'preview', { rotate_sh: false }) },
    { name: 'a capture, standard', scene: 'capture', dataset: true, request: corrected(both, 'standard', { intervals: 1 }), ...others },
    { name: 'a capture, paper', scene: 'capture', dataset: true, request: corrected(ball, 'paper', { iterations: 6, intervals: 1, annealing_steps: 2 }) },
    { name: 'a capture, extend', scene: 'capture', dataset: false, request: corrected(leaf, 'draft', {}, extend) },
    { name: 'a scene of another format', scene: 'splat', dataset: true, request: corrected(ball, 'draft') },
  ];
};
