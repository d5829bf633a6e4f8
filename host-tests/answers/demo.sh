rotorlead demo --json 01-demo.json
rotorlead design --kind lead --json 02-design.json --model demo-out/model.toml --out compensator.toml
rotorlead bandwidth --json 03-bandwidth.json --model demo-out/model.toml --compensator compensator.toml
rotorlead simulate --model demo-out/model.toml --out plain
rotorlead simulate --model demo-out/model.toml --compensator compensator.toml --out compensated
rotorlead identify --json 04-identify.json plain --out model.toml
rotorlead validate --json 05-validate.json plain --model model.toml
rotorlead bandwidth --json 06-bandwidth.json --model model.toml --compensator compensator.toml --records plain --records compensated
rotorlead diagnose --json 07-diagnose.json plain
rotorlead diagnose --json 08-diagnose.json compensated --model demo-out/model.toml
