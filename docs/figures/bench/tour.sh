#!/usr/bin/env bash
# Pastes the README's lines one by one, and prints what each says and how long it takes, as docs/guide/tour.md:
#
#   cargo build --release --workspace --bins && bash docs/figures/bench/tour.sh target/release >docs/guide/tour.md
#
# They run in a new folder with a home of its own, which are gone afterwards. Lines of cargo, which are for the clone, are left
# out, and so are those of containers: `tour.sh PROGRAMS containers` pastes only these, in the folder one stands in. A line that
# does not end with 0 ends the tour. TOUR_PORTS=free takes other ports than the README's.
set -u
programs=$(cd "$1" && pwd) && what=${2:-programs}
readme=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)/README.md
scratch=$(mktemp -d) && said=$scratch/said && mkdir "$said" || exit 1
# Whatever a line left in the background ends with the tour.
trap 'kill $(jobs -p) 2>/dev/null; wait; rm -rf "$scratch"' EXIT

# The README's shell blocks of the kind that is wanted, a blank line behind each.
blocks() {
    awk '/^```sh$/ { inside = 1; next } /^```$/ { if (inside) print ""; inside = 0; next } inside' "$readme" |
        awk -v RS= -v ORS='\n\n' -v what="$what" '/^cargo / { next } (/docker-compose/ ? "containers" : "programs") == what'
}

free_port() {
    local port
    while port=$((20000 + RANDOM % 12000)) && (exec 4<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; do :; done
    echo "$port"
}

ports=(7001 7002)
[ "${TOUR_PORTS:-}" != free ] || ports=("$(free_port)" "$(free_port)")
PATH=$programs:$PATH
if [ "$what" = programs ]; then
    export HOME=$scratch/home && unset XDG_CACHE_HOME XDG_CONFIG_HOME
    mkdir "$HOME" "$scratch/tour" && cd "$scratch/tour" || exit 1
fi
# Compose is a program of its own, or a command of Docker's.
command -v docker-compose >/dev/null || docker-compose() { docker compose "$@"; }

mapfile -t lines < <(blocks)
tenths=() start=$EPOCHREALTIME
for number in "${!lines[@]}"; do
    line=${lines[number]}
    [ -n "$line" ] || continue
    line=${line//127.0.0.1:7001/127.0.0.1:${ports[0]}} line=${line//127.0.0.1:7002/127.0.0.1:${ports[1]}}
    begun=${EPOCHREALTIME/[.,]/}
    if ! eval "$line" >"$said/$number" 2>&1 </dev/null; then
        { echo "this line of the README fails:" && echo "  ${lines[number]}" && cat "$said/$number"; } >&2
        exit 1
    fi
    tenths[number]=$(((${EPOCHREALTIME/[.,]/} - begun + 50000) / 100000))
done
took=$(((${EPOCHREALTIME/[.,]/} - ${start/[.,]/} + 500000) / 1000000))

processor=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)
cat <<END
# The tour

Every line of the [README](../../README.md) but those of cargo and of containers, pasted into a shell, one by one, in an empty
folder: what each prints, also that of the background, and its seconds. Made by
[docs/figures/bench/tour.sh](../figures/bench/tour.sh) on $(nproc) cores of ${processor:-an unknown processor}, programs of $1:
$took s for all.

END
# Folders of this machine are nobody's business.
hidden() { sed -e "s|$scratch/home|~|g" -e "s|$scratch/tour|.|g" -e "s|$programs|bin|g" -e 's/[[:space:]]*$//' "$1"; }
echo '```console'
for number in "${!lines[@]}"; do
    if [ -n "${lines[number]}" ]; then
        echo "\$ ${lines[number]}" && hidden "$said/$number"
        echo "[$((tenths[number] / 10)).$((tenths[number] % 10)) s]"
    elif [ "$number" != $((${#lines[@]} - 1)) ]; then
        printf '```\n\n```console\n'
    fi
done
echo '```'
