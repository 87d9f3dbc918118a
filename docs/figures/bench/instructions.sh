#!/bin/sh
# Instructions a sample of the processor's kernel, which a busy machine counts as a quiet one does, for the table of the
# same name in docs/figures/benchmarks.md; valgrind (callgrind) must be there, which knows no AVX-512:
#   cargo build --release -p brickcast-cpu --example kernel
#   sh docs/figures/bench/instructions.sh target/release/examples/kernel [TABLE]
# prints the table. With TABLE, a file that holds one, it is compared, and fails where a number grew by more than 3 %.
set -eu
kernel=$1 table=${2:-}
styles="sampled slabs lit lit-slabs surface mip skipping opaque"
grown=0

# set, style: instructions of the picture by samples.
count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect='*render_tile*' \
        "$kernel" "$1" "$2" 1 64 2>&1 |
        awk '/samples, sum/ { for (i = 2; i <= NF; i++) if ($i ~ /^samples/) n = $(i - 1) }
            /Collected :/ { if (n > 0) printf "%.1f", $NF / n }'
}

# style, column: the number in TABLE.
before() {
    awk -F '|' -v style="$1" -v column="$2" '
        /^\| instructions a sample/ { here = 1 }
        here && !/^\|/ { here = 0 }
        here { name = $2; gsub(/[ `]/, "", name); if (name == style) print $(column + 2) + 0 }' "$table"
}

echo "| instructions a sample | SSE2 | AVX2 |"
echo "| --- | --- | --- |"
for style in $styles; do
    row="| \`$style\` |"
    column=0
    for set in sse2 avx2; do
        column=$((column + 1))
        now=$(count $set "$style")
        if [ -z "$now" ]; then
            echo "$kernel $set $style: no count; are valgrind and the program there?" >&2
            exit 2
        fi
        row="$row $now |"
        if [ -n "$table" ]; then
            known=$(before "$style" $column)
            if [ -z "$known" ]; then
                echo "$table: no row $style in the table 'instructions a sample'" >&2
                exit 2
            fi
            if awk -v now="$now" -v known="$known" 'BEGIN { exit !(now > known * 1.03) }'; then
                echo "$style by $set: $now instructions a sample, $known before" >&2
                grown=1
            fi
        fi
    done
    echo "$row"
done
exit $grown
