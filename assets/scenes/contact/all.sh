#!/bin/sh
# Runs the contact scenes and writes a table of what came out, a trajectory and a clip of each:
#
#     sh assets/scenes/contact/all.sh FOLDER [SCENE...]      # in the folder of the repository
#
# SELVEDGE names the program (target/release/selvedge), CLIPS=no leaves the clips out.
set -u
here=$(dirname "$0")
program=${SELVEDGE:-target/release/selvedge}
folder=${1:?name a folder for the results}
shift
[ $# -gt 0 ] || set -- "$here"/*.toml "$here"/../worn/*.toml
mkdir -p "$folder"
echo "| scene | vertices | frames | ms per frame | divisions | smallest gap | intersections |" | tee "$folder/table.md"
echo "|---|---|---|---|---|---|---|" | tee -a "$folder/table.md"
for scene in "$@"; do
    name=$(basename "$scene" .toml)
    if ! "$program" run "$scene" -o "$folder/$name.safetensors" >"$folder/$name.txt" 2>"$folder/$name.log"; then
        echo "| $name | $(tail -n 1 "$folder/$name.log" | sed 's/^error: //') ||||||" | tee -a "$folder/table.md"
        continue
    fi
    awk -v name="$name" '
        $1 == "vertices" { vertices = $2 }
        $1 == "frames" { frames = $2 }
        $1 == "time" { time = $2 }
        $1 == "contact" {
            met = $2 == "no" ? 0 : $2
            gap = match($0, /smallest gap [0-9.]+ mm/) ? substr($0, RSTART + 13, RLENGTH - 13) : "above the thickness"
        }
        $1 == "solves" { divisions = $5 }
        END { print "| " name " | " vertices " | " frames " | " time " | " divisions + 0 " | " gap " | " met " |" }
    ' "$folder/$name.txt" | tee -a "$folder/table.md"
    [ "${CLIPS:-yes}" = no ] || "$program" export "$folder/$name.safetensors" -o "$folder/$name.gif" >/dev/null
done
