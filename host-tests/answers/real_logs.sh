answers() {
  rotorlead import "$1" --excitation staircase --out "$2"
  rotorlead identify --json "$2-identify.json" "$2" --out "$2.toml"
  rotorlead validate --json "$2-validate.json" "$2" --model "$2.toml"
  rotorlead design --kind lead --json "$2-design.json" --model "$2.toml" --out "$2.compensator.toml"
  rotorlead bandwidth --json "$2-bandwidth.json" --model "$2.toml" --compensator "$2.compensator.toml"
  rotorlead diagnose --json "$2-diagnose.json" "$2"
}
# A DShot command is 0 to 2047 without a unit.
in_percent() {
  awk -F, -v OFS=, 'NF < 5 {next} FNR == 1 {sub("ESC signal", "ESC signal (%)")} FNR > 1 {$2 /= 20.47} {print}' "$1" > "$2.csv"
}
answers "$LOGS/alspitz_esc_test/Log_2019-11-09_181347.csv" rcbenchmark
answers "$LOGS/alspitz_esc_test/f40_steps_5-2.csv" f40
answers "$LOGS/alspitz_esc_test/esc32v3_f60-1.csv" f60
in_percent "$LOGS/sar_simulation/micro_2023-12-17_162234.csv" micro
answers micro.csv micro
in_percent "$LOGS/sar_simulation/so_v5_2023-12-13_130935.csv" so_v5
answers so_v5.csv so_v5
