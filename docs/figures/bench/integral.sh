#!/bin/sh
# The runs behind docs/explanation/integral.md: sh docs/figures/bench/integral.sh BRICKCAST DATA OUT
# DATA holds engine.nrrd and bonsai.nrrd, and shells.nrrd and marschner_lobb.nrrd of
# `cargo run -p brickcast-volume --example fields -- DATA`; DATA/256 holds those of `... -- DATA/256 256`.
# OUT gets a JSON file for each run. REPEAT: timed frames, 5 without it; errors do not depend on it.
set -eu
brickcast=$1 data=$2 out=$3
bench=$(dirname "$0")
view="--azimuth 30 --elevation 20 --filter exact --early-termination 1 --accel ess"
mkdir -p "$out"

# volume, largest value, transfer function, more flags...
run() {
    volume=$1 most=$2 function=$3
    shift 3
    name=$(echo "$volume-$function${KIND:-}" | tr / -)
    echo "== $name $*"
    # Shares of the range become data values.
    "$brickcast" bench "$data/$volume.nrrd" --table lum --transfer-function "$bench/$function.json" \
        --transfer-function-range "$(functions "$function" "$most")" $view "$@" --json "$out/$name.json"
}

# Where the points of a function lie, as shares of the range.
functions() {
    case $1 in
        smooth|spiky|peak) lo=0 hi=1 ;;
        window) lo=0.3 hi=0.6 ;;
        slab) lo=0.49 hi=0.51 ;;
        edge) lo=0.49 hi=0.51 ;;
    esac
    awk -v lo=$lo -v hi=$hi -v most="$2" 'BEGIN { printf "%.3f,%.3f", lo * most, hi * most }'
}

for function in smooth spiky slab window peak; do
    for volume in engine bonsai; do
        run $volume 255 $function --backend cpu --size 512x512 --repeat "${REPEAT:-5}"
    done
    for volume in marschner_lobb shells; do
        run $volume 65535 $function --backend cpu --size 512x512 --repeat "${REPEAT:-5}"
    done
done
lit="--backend cpu --size 256x256 --repeat 1 --shading phong --light 1,1,0.5 --specular 0.6 --shininess 30"
KIND=-lit
for volume in shells marschner_lobb 256/marschner_lobb; do
    run $volume 65535 edge $lit
done
KIND=-opaque
for volume in shells 256/marschner_lobb; do
    run $volume 65535 edge $lit --opacity-unit 0.05
done
