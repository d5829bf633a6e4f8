cat > motor.toml <<'END'
format = 1
[[point]]
nominal = 0.5
gain = 10.0
time_constant_s = 0.1
END
rotorlead simulate --model motor.toml --out run
rotorlead identify --json 01-identify.json run --out model.toml
rotorlead validate --json 02-validate.json run --model model.toml
