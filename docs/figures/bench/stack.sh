#!/usr/bin/env bash
# A stack of TIFF files and one NIfTI.gz of the same voxels, prepared: MB/s of voxels and peak memory, beside cp of the files
# and reading them in tifffile, in one run. Another stack of many small files.
#   PATH=target/release:$PATH docs/figures/bench/stack.sh FOLDER [X,Y,Z [MANY]]
set -euo pipefail
folder=${1:?a folder with room}; dims=${2:-2048,2048,1024}; many=${3:-10000}
mkdir -p "$folder"; cd "$folder"
timed() { # NAME MEGABYTES COMMAND...
    local name=$1 megabytes=$2 start; shift 2
    sync; start=$(date +%s.%N)
    /usr/bin/time -f '%M' -o rss "$@" >out.log 2>&1 || { tail -3 out.log; return 1; }
    python3 -c "import sys; s = $(date +%s.%N) - $start; print(f'| $name | {s:.1f} s | {$megabytes / s:.0f} MB/s | {$(tail -1 rss) / 1048576:.2f} GiB |', flush=True)"
}
[ -d stack ] || {
    brickcast -q phantom part.nrrd --dims "$dims" --pores 200 --noise 1.5
    python3 - "$dims" "$many" <<'P'
import os, sys, numpy as np, tifffile
x, y, z = map(int, sys.argv[1].split(','))
many = int(sys.argv[2])
start = os.path.getsize('part.nrrd') - 2 * x * y * z
voxels = np.memmap('part.nrrd', '<u2', 'r', start, (z, y, x))
os.mkdir('stack'); os.mkdir('many')
for i in range(z):
    tifffile.imwrite(f'stack/s{i:05}.tif', voxels[i])
for i in range(many):
    tifffile.imwrite(f'many/s{i:05}.tif', voxels[i % z, y // 4:y // 4 + 512, x // 4:x // 4 + 512])
P
    brickcast -q convert part.nrrd part.nii.gz
    rm part.nrrd part.pores.json
}
IFS=, read -r x y z <<<"$dims"
mb=$((2 * x * y * z / 1000000)); mb_many=$((2 * 512 * 512 * many / 1000000))
cat > read.py <<'P'
import glob, sys, tifffile
for name in sorted(glob.glob(sys.argv[1] + '/*.tif')):
    tifffile.imread(name)
P
echo "| what | time | speed | peak RSS |"; echo "| --- | ---: | ---: | ---: |"
timed "cp of the stack" $mb cp -r stack copy; rm -r copy
timed "tifffile reads the stack" $mb python3 read.py stack
timed "info of the stack" $mb brickcast -q info stack
timed "prepare of the stack" $mb brickcast -q prepare stack store; rm -r store
timed "prepare of the NIfTI.gz" $mb brickcast -q prepare part.nii.gz store; rm -r store
timed "cp of $many files" $mb_many cp -r many copy; rm -r copy
timed "tifffile reads $many files" $mb_many python3 read.py many
timed "prepare of $many files" $mb_many brickcast -q prepare many store; rm -r store
