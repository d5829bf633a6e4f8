rotorlead import "$SOURCES/sim/records/tests/data/rcbenchmark.csv" --out stand
rotorlead identify --json 01-identify.json stand --out model.toml
rotorlead design --json 02-design.json --model model.toml --out compensator.toml
rotorlead bandwidth --json 03-bandwidth.json --model model.toml --compensator compensator.toml
