// Runs Khronos' glTF validator on the files named on the command line; prints one JSON report for all.
// Exit status 77 where the validator is not installed.
'use strict';
const fs = require('fs');
let validator;
try {
  validator = require('gltf-validator');
} catch (error) {
  console.error('gltf-validator is not installed: run npm ci --prefix tests/foreign');
  process.exit(77);
}
(async () => {
  const reports = {};
  for (const name of process.argv.slice(2)) {
    reports[name] = await validator.validateBytes(new Uint8Array(fs.readFileSync(name)));
  }
  console.log(JSON.stringify(reports));
})();
