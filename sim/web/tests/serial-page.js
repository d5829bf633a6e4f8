// The section of the box alone, with a compensator that a test puts into a field.

import { deviceSection } from "./device.js";

const text = document.querySelector("#compensator");
// The emulated box is slower than time.
deviceSection(document.querySelector("#device"), { compensator: () => text.value || null, limitS: 20 });
