// SPDX-License-Identifier: Apache-2.0
// What a page carries as gzip in base64, as packed.py zips it.
"use strict";

const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

// A response with the bytes or the text that was zipped.
const unzipped = (text) => new Response(new Blob([bytes(text)]).stream().pipeThrough(new DecompressionStream("gzip")));
