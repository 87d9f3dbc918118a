#!/bin/sh
# The runs behind docs/integral.md: sh docs/bench/integral.sh BRICKCAST DATA OUT
# DATA holds engine.nrrd and bonsai.nrrd, and shells.nrrd and marschner_lobb.nrrd of
# `cargo run -p brickcast-volume --example fields -- DATA`; OUT gets a JSON file for each run.
set -eu
brickcast=$1 data=$2 out=$3
bench=$(dirname "$0")
view="--azimuth 30 --elevation 20 --size 512x512 --filter exact --early-termination 1 --accel ess --repeat 3"
mkdir -p "$out"

# volume, largest value, transfer function, more flags...
run() {
    volume=$1 most=$2 function=$3
    shift 3
    echo "== $volume, $function $*"
    # Shares of the range become data values.
    "$brickcast" bench "$data/$volume.nrrd" --table lum --transfer-function "$bench/$function.json" \
        --transfer-function-range "$(functions "$function" "$most")" $view "$@" --json "$out/$volume-$function${KIND:-}.json"
}

# Where the points of a function lie, as shares of the range.
functions() {
    case $1 in
        smooth|spiky) lo=0 hi=1 ;;
        slab) lo=0.49 hi=0.51 ;;
        edge) lo=0.49 hi=0.51 ;;
    esac
    awk -v lo=$lo -v hi=$hi -v most="$2" 'BEGIN { printf "%.3f,%.3f", lo * most, hi * most }'
}

for function in smooth spiky slab; do
    for volume in engine bonsai; do
        run $volume 255 $function --backend cpu
    done
    for volume in marschner_lobb shells; do
        run $volume 65535 $function --backend cpu
    done
done
KIND=-lit
for volume in shells marschner_lobb; do
    run $volume 65535 edge --backend cpu --shading phong --light 1,1,0.5 --specular 0.6 --shininess 30
done
