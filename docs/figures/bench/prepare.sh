#!/usr/bin/env bash
# What `brickcast prepare` makes of a raw volume a second, with and without regions, against `cp` of the same file in
# the same run:
#
#   docs/figures/bench/prepare.sh FOLDER [GIB...]     with brickcast on the PATH; FOLDER is made; 1 4 12 without sizes
#
# Prints a table. Voxels are u16, of `brickcast phantom`; each run begins without the file in the system's cache and ends
# when all that it wrote is on the disk. Three times the largest size must be free; all is removed again. RUNS: of each
# the fastest of so many, 1 without it. LEVELS: `--levels`, `auto` without it.
set -euo pipefail
folder=$1
shift
[ $# -gt 0 ] || set -- 1 4 12
made=0
[ -d "$folder" ] || made=1
mkdir -p "$folder"
cd "$folder"
cleared() { rm -rf v.nrrd v.pores.json copy store; [ "$made" = 0 ] || rmdir "$PWD" 2>/dev/null || true; }
trap cleared EXIT
TIMEFORMAT='%R %U %S'

forgotten() { dd if=v.nrrd iflag=nocache count=0 status=none; }
flushed() { "$@" && sync -f .; }

# NAME BYTES COMMAND...: the fastest run as a row. Between runs what was made goes.
row() {
    local name=$1 bytes=$2 best= took
    shift 2
    for _ in $(seq "${RUNS:-1}"); do
        rm -rf copy store
        sync -f .
        forgotten
        took=$( { time flushed "$@" >/dev/null 2>said; } 2>&1) || { cat said >&2; exit 1; }
        if [ -z "$best" ] || awk -v a="${took%% *}" -v b="${best%% *}" 'BEGIN { exit !(a < b) }'; then best=$took; fi
    done
    awk -v name="$name" -v bytes="$bytes" -v best="$best" -v stored="$(du -sbc copy store 2>/dev/null | tail -1 | cut -f1)" '
        BEGIN { split(best, t, " ")
            printf "| %s | %.1f | %.0f | %.1f | %.2f |\n", name, t[1], bytes / 1e6 / t[1], t[2] + t[3], stored / bytes }'
    rm -rf copy store said
}

echo "| of | seconds | MB/s | seconds of the processor | bytes written a byte read |"
echo "| --- | --- | --- | --- | --- |"
for gib in "$@"; do
    edge=1024 depth=$((512 * gib))
    if [ "$gib" -ge 4 ]; then edge=2048 depth=$((128 * gib)); fi
    brickcast -q phantom v.nrrd --dims "$edge,$edge,$depth" --pores 500 --force
    bytes=$((gib << 30))
    what="$gib GiB, $edge x $edge x $depth"
    row "\`cp\`, $what" "$bytes" cp v.nrrd copy
    row "\`prepare\`, $what" "$bytes" brickcast -q prepare v.nrrd store --levels "${LEVELS:-auto}"
    row "the same with \`--segmentation-range 0.03\`" "$bytes" \
        brickcast -q prepare v.nrrd store --segmentation-range 0.03 --levels "${LEVELS:-auto}"
    rm -f v.nrrd v.pores.json
done
