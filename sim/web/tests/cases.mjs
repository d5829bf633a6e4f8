// Logs of other people's stands and of cases that came out wrong once, with what each does not say of itself: the options that
// `rotorlead import` needs.

const staircase = { excitation: "staircase" };

/** Where a log lies below the folder of data, and its options; first what takes longest. */
export const CASES = [
  { log: "alspitz_esc_test/Log_2019-11-09_181347.csv", options: {} },
  { log: "alspitz_esc_test/Log_2019-11-05_171350.csv", options: {} },
  { log: "alspitz_esc_test/Log_2019-11-07_184325.csv", options: {} },
  { log: "alspitz_esc_test/esc32v3_f60-1.csv", options: {} },
  { log: "alspitz_esc_test/f40_steps_5-2.csv", options: {} },
  { log: "sar_simulation/micro_2023-12-17_162234.csv", options: { ...staircase, column: ["command=ESC signal:dshot"] } },
  { log: "sar_simulation/so_v5_2023-12-13_130935.csv", options: { ...staircase, column: ["command=ESC signal:dshot"] } },
  { log: "sar_simulation/so_v5_steps_2024-02-06_103903.csv", options: {} },
  { log: "cases/command-stamps-dropped/log.bin", options: {} },
  { log: "cases/command-stamps-dropped/log.ulg", options: {} },
  { log: "cases/curved-map-blamed-on-heat/log.csv", options: { ...staircase, column: ["command=command:duty"] } },
  { log: "cases/dshot-order-blocks-guess/log.csv", options: staircase },
  { log: "cases/esc-rpm-called-command/log.csv", options: staircase },
  { log: "cases/interleaved-series/log.csv", options: { ...staircase, column: ["time=__time:s", "command=/motor/command:duty", "rpm=/motor/rpm:rpm"] } },
  { log: "cases/latin1-byte-in-comment/log.csv", options: staircase },
  { log: "cases/mat-column-ignored/log.mat", options: { ...staircase, column: ["command=u:duty", "rpm=y:rpm", "time=t:s"] } },
  { log: "cases/motor-2-moves/log.bin", options: {} },
  { log: "cases/newtons-called-grams/table.csv", options: { excitation: "steady" } },
  { log: "cases/prbs-not-named/log.csv", options: { column: ["command=command:duty"] } },
  { log: "cases/ramp-called-usable/log.csv", options: { ...staircase, column: ["command=command:duty"] } },
  { log: "cases/slower-of-two-speeds/log.csv", options: { ...staircase, column: ["command=ESC signal:dshot"] } },
  { log: "cases/stall-thrust-up-steps/log.csv", options: { ...staircase, column: ["command=ESC signal:dshot"] } },
  { log: "cases/thrust-square-called-unequal-lags/log.csv", options: { ...staircase, column: ["command=command:duty"] } },
];

/** Options as the command line takes them. */
export function typed(options) {
  return Object.entries(options).flatMap(([name, value]) => [value].flat().flatMap((one) => [`--${name}`, one]));
}
