cat > table3.csv <<'END'
u_nom,uncompensated_rad_s,compensated_rad_s
0.40,7.6139,10.5564
0.45,9.0941,33.5233
0.50,11.7689,68.9652
0.55,14.4992,72.9550
0.60,15.1641,85.8608
0.65,14.7953,97.1847
END
cat > model.toml <<'END'
format = 1
[[point]]
nominal = 0.40
gain = 9.9955
time_constant_s = 0.1593422
[[point]]
nominal = 0.45
gain = 10.4556
time_constant_s = 0.1360100
[[point]]
nominal = 0.50
gain = 10.1718
time_constant_s = 0.1076554
[[point]]
nominal = 0.55
gain = 10.9196
time_constant_s = 0.1008776
[[point]]
nominal = 0.60
gain = 13.4519
time_constant_s = 0.0851506
[[point]]
nominal = 0.65
gain = 16.1063
time_constant_s = 0.0707839
END
rotorlead design --kind lead --json 01-design.json --model model.toml --out c.toml
rotorlead diagnose --json 02-diagnose.json --bandwidths table3.csv --model model.toml --compensator c.toml --out-model improved.toml
rotorlead bandwidth --json 03-bandwidth.json --model improved.toml --compensator c.toml
