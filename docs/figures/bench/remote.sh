#!/usr/bin/env bash
# First frame of a store on the disk and on a web server, at once and 200 ms after each request.
#
#   docs/figures/bench/remote.sh FOLDER [EDGE]     with brickcast on the PATH; FOLDER is made
set -euo pipefail
folder=$1 edge=${2:-256}
mkdir -p "$folder/data"
cd "$folder"
[ -e data/part ] || { brickcast -q phantom part.nrrd --dims "$edge,$edge,$edge" && brickcast -q prepare part.nrrd data/part --segmentation-range 0.03; }
cat >server.py <<'PY'
"""Files of `data` by ranges; counts requests. Arguments: port, seconds before each answer."""
import http.server, os, sys, time
class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    count = 0
    def log_message(self, *_): pass
    def do_GET(self):
        if self.path == "/count":
            body = str(Handler.count).encode(); Handler.count = 0
            return self.answer(200, body)
        Handler.count += 1
        time.sleep(float(sys.argv[2]))
        path = "data" + self.path
        if not os.path.isfile(path):
            return self.answer(404, b"")
        size = os.path.getsize(path)
        first, last = (int(n) for n in self.headers["Range"][6:].split("-"))
        last = min(last, size - 1)
        if first > last:
            return self.answer(416, b"")
        with open(path, "rb") as file:
            file.seek(first)
            self.answer(206, file.read(last - first + 1), f"bytes {first}-{last}/{size}")
    def answer(self, status, body, span=None):
        self.send_response(status)
        if span: self.send_header("Content-Range", span)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)
http.server.ThreadingHTTPServer.daemon_threads = True
http.server.ThreadingHTTPServer.request_queue_size = 256
http.server.ThreadingHTTPServer(("127.0.0.1", int(sys.argv[1])), Handler).serve_forever()
PY
servers=()
trap 'kill "${servers[@]}"' EXIT
python3 server.py 18090 0 & servers+=($!)
python3 server.py 18091 0.2 & servers+=($!)
sleep 1
# name place flags...: seconds of the whole command, median of five, and requests of one.
measure() {
    local name=$1 place=$2 times=() start
    shift 2
    for _ in 1 2 3 4 5; do
        start=$(date +%s.%N)
        brickcast -q render "$place" -o "$name.png" --backend cpu --size 768x768 --no-manifest "$@"
        times+=("$(echo "$(date +%s.%N) - $start" | bc)")
    done
    local requests=-
    case $place in http*) requests=$(($(curl -s "${place%/part}/count") / 5)) ;; esac
    echo "$name $*: $(printf '%s\n' "${times[@]}" | sort -n | sed -n 3p) s, $requests requests"
}
for flags in "--exact" "--exact --accel leap" "--exact --lod 1"; do
    measure disk data/part $flags
    measure web http://127.0.0.1:18090/part $flags
    measure far http://127.0.0.1:18091/part $flags
    cmp disk.png web.png && cmp disk.png far.png
done
du -sh data/part
