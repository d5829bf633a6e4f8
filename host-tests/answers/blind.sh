blind --tool "$(command -v rotorlead)" --set tune --seeds 2 --rivals none --jobs 2 --keep . > /dev/null
for case in cases/*; do
  name=$(basename "$case")
  # Records with uneven stamps are refused.
  [ -s "answers/$name.json" ] || continue
  mv "answers/$name.json" "$name-diagnose.json"
  # Some cases bring a model and no record to make one from, or records that the model does not reach: these give no answer.
  rotorlead identify --json "$name-identify.json" "$case" --out model.toml || continue
  rotorlead validate --json "$name-validate.json" "$case" --model model.toml || continue
done
