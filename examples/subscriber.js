// Hears one sweep of a running pzctl daemon and prints its numbers, one line each: frequency R X, exactly.
//
// npm install zeromq && node subscriber.js DAEMON.JSON, the file that `pzctl daemon` writes into its data folder
"use strict";
const fs = require("fs");
const zmq = require("zeromq");

async function main(path) {
  const { events: endpoint, key } = JSON.parse(fs.readFileSync(path, "utf8"));
  const events = new zmq.Subscriber();
  events.curveServerKey = key.server;
  events.curvePublicKey = key.public;
  events.curveSecretKey = key.secret;
  events.subscribe();
  events.connect(endpoint);
  for await (const [topic, head, ...raw] of events) {
    if (topic.toString() === "welcome.") process.stderr.write("listening\n");
    if (!topic.toString().startsWith("sweep.")) continue;
    const header = JSON.parse(head.toString());
    const columns = {};
    header.columns.forEach((column, k) => {
      // copied, since a Float64Array must begin at a multiple of 8 bytes
      columns[column.name] = new Float64Array(new Uint8Array(raw[k]).buffer);
    });
    const { frequency: f, impedance: z } = columns;
    for (let k = 0; k < f.length; k++) console.log(`${f[k]} ${z[2 * k]} ${z[2 * k + 1]}`);
    break;
  }
  events.close();
}

main(process.argv[2]);
