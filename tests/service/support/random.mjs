// Chance that can be repeated.

/// Numbers in [0, 1), the same for the same seed (mulberry32), and what is made of them.
export const randomFrom = (seed) => {
  let state = seed | 0;
  const random = () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
  random.below = (count) => Math.floor(random() * count);
  random.of = (items) => items[random.below(items.length)];
  return random;
};
