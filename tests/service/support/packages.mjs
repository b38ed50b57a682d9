// The packages the tests need, or one clear sentence.
const load = async (name) => {
  try {
    return await import(name);
  } catch (error) {
    if (error.code !== 'ERR_MODULE_NOT_FOUND') throw error;
    throw new Error(`The package ${name} is not installed: run "npm ci --prefix tests/service" first.`);
  }
};

export const { default: { default: Ajv2020 } } = await load('ajv/dist/2020.js');
export const { parse: parseYaml, parseDocument: parseYamlDocument, visit: visitYaml } = await load('yaml');
export const loadBrowser = async () => (await load('playwright-core')).chromium;
