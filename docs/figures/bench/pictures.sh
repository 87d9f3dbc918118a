#!/bin/sh
# Every style, projection, clip, region view and acceleration, exact and not, on 1, 2 and 3 nodes, as float pictures
# with their checksums: sh docs/figures/bench/pictures.sh BRICKCAST OUT. Of two programs that draw the same,
# `diff A/sums B/sums` prints nothing. The GPU's kernel draws each style once, on one node (BACKENDS=cpu leaves it out).
# LIMIT names the cases to draw, as a pattern.
set -eu
brickcast=$1 out=$2
mkdir -p "$out"
out=$(cd "$out" && pwd)
if [ ! -d "$out/../part" ]; then
    (cd "$out/.." && "$brickcast" phantom part.nrrd --dims 72,64,56 --pores 12 --seed 3 --force -q &&
        "$brickcast" prepare part.nrrd part --brick 16 --segmentation-range 0.03 --force -q)
fi
part=$out/../part
: >"$out/list"

# NAME FLAG...: exact and not, on 1, 2 and 3 nodes.
draw() {
    name=$1
    shift
    case $name in ${LIMIT:-*}) ;; *) return 0 ;; esac
    for exact in "" --exact; do
        for nodes in 1 2 3; do
            one "$name${exact:+-exact}-$nodes" --local "$nodes" --backend cpu $exact "$@"
        done
    done
    case ${BACKENDS:-cpu,gpu} in *gpu*) one "$name-gpu" --local 1 --backend gpu --size 64x48 "$@" ;; esac
}

one() {
    file=$1
    shift
    size="--size 120x90"
    case " $* " in *" --size "*) size= ;; esac
    "$brickcast" render "$part" -o "$out/$file.exr" $size --azimuth 35 --elevation 25 --no-manifest -q "$@"
    echo "$file" >>"$out/list"
}

window="--window 3000,52000 --opacity 0.3 --colormap viridis"
sampled="$window --integration sampled"
draw slabs $window
draw default
draw sampled $sampled
draw table256 $window --table-size 256
for lighting in interpolated center centroid; do
    draw "lit-$lighting" $window --shading phong --lighting "$lighting"
done
draw lit-sampled $sampled --shading phong --light 1,2,0.5 --specular 0.4 --light-from 0
draw surface --isosurface 20000
draw surfaces $window --isosurface 20000:1,0.2,0.1,0.4 --isosurface 45000:0.2,0.4,1 --shading phong
for mode in mip minip average; do
    draw "$mode" $window --mode "$mode"
done
draw clip $window --clip 0.5,3,0.5,3,0.5,3
draw planes $window --shading phong --clip-plane 1,0,0,1.5 --clip-plane 0,-1,0.3,-3
draw surface-cut --isosurface 20000 --clip-plane 1,0,0,1.5
for view in regions residual; do
    draw "view-$view" $window --view "$view"
    draw "view-$view-sampled" $sampled --view "$view"
done
for accel in none ert ess leap macro; do
    draw "accel-$accel" $window --accel "$accel"
    draw "accel-$accel-sampled" $sampled --accel "$accel"
    draw "accel-$accel-lit" $window --shading phong --accel "$accel"
done
draw macrocell8 $window --macrocell 8
draw tolerance $window --leap-tolerance 0.01
for filter in exact hardware; do
    draw "filter-$filter" $window --filter "$filter"
done
draw nearest $sampled --filter nearest
draw step $window --step 0.37 --opacity-unit 0.4
draw inside $window --zoom 4
draw parallel $sampled --zoom 1.5 --view-angle 50

cd "$out"
sort list | while read -r file; do sha256sum "$file.exr"; done >sums
echo "$(wc -l <sums) pictures, their checksums in $out/sums"
