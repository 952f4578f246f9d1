#!/usr/bin/env bash
# Measures the figures of docs/QUALITY.md and prints its tables (Markdown).
#   tests/replay/measure_quality.sh BUILD_DIR [DATA_DIR [SECTION...]]
# SECTION: conveyor people baseball eleven middlebury highway scenes tracking; all without one. SEEDS="1" for fewer,
# SCENES="crossing far" for some of tracking's.
set -euo pipefail

die() {
  printf 'measure_quality.sh: %s\n' "$1" >&2
  exit "${2:-1}"
}

[[ $# -ge 1 ]] || die "usage: measure_quality.sh BUILD_DIR [DATA_DIR [SECTION...]]" 2
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=$(cd "$1" && pwd)
data=${2:-$root/../shared/data}
sections=("${@:3}")
((${#sections[@]})) || sections=(conveyor people baseball eleven middlebury highway scenes tracking)
stereotrack=$build/bin/stereotrack
for program in "$stereotrack" "$build"/tests/{score_masks,score_disparity,score_path,opencv_masks,opencv_tracker}; do
  [[ -x $program ]] || die "$program: not there; build it first"
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Runs quietly; what it said is shown only when it fails.
quiet() { "$@" >"$work/log" 2>&1 || die "$* failed: $(tail -n 1 "$work/log")"; }

# The value of a line "NAME VALUE" of a scorer, from stdin.
value() { awk -v name="$1" '$1 == name {print $2}'; }
percent() { awk -v name="$1" '$1 == name {printf "%.1f", 100 * $2}'; }

replay() {
  local out=$1 source=$2
  shift 2
  quiet "$stereotrack" replay "$source" --out "$out" "$@"
}

# Tracks with a row in frames A..B.
ids_in() { awk -F, -v a="$2" -v b="$3" '$1 >= a && $1 <= b && !($2 in s) {s[$2]; n++} END {print n + 0}' "$1"; }

measure_conveyor() {
  local source=$data/dtu_conveyor_stereo tracks=$work/conveyor/tracks.csv box line
  replay "$work/conveyor" "$source" --calibration "$source/derived_stereo_calibration.yml"
  box=$("$build/tests/score_path" --tracks "$tracks" --frames 106:252)
  line=$("$build/tests/score_path" --tracks "$tracks" --frames 180:250 --id "$(value id <<<"$box")")
  cat <<END
| conveyor | measured | target |
|---|---|---|
| best track's share of frames 106-252, % | $(percent coverage <<<"$box") | 95 |
| tracks in frames 106-252 (box, hands, others) | $(value ids <<<"$box") | one on the box |
| the box's track in frames 180-250, % | $(percent coverage <<<"$line") | 95 |
| residual from a straight line at constant speed, 180-250, squares | $(value rms_3d <<<"$line") | 0.06 |
| speed, squares a frame | $(value speed_a_frame <<<"$line") | 0.173 |
| tracks on the empty belt, frames 1-80 | $(ids_in "$tracks" 1 80) | 0 |

Rows of each track in frames 106-252 as [track, rows]: $(sed -n 's/^rows_of_ids *//p' <<<"$box")

END
}

# A track belongs to the pass in which at least half of its rows lie.
measure_people() {
  local source=$data/stereo_people_overhead
  replay "$work/people" "sbs:$source/my_video_sbs_640x240.avi" --calibration "$source/calibration_as_stored.yml"
  printf '| overhead people | measured | target |\n|---|---|---|\n'
  awk -F, '
    function pass(f) {
      return f >= 57 && f <= 81 ? 1 : f >= 102 && f <= 120 ? 2 : f >= 138 && f <= 174 ? 3 : f >= 207 && f <= 237 ? 4 : 0
    }
    {rows[$2]++; in_pass[$2, pass($1)]++}
    END {
      split("57-81 102-120 138-174 207-237", name, " ")
      for (id in rows) {
        home = 0
        for (p = 1; p <= 4; p++) if (2 * in_pass[id, p] >= rows[id]) home = p
        tracks[home]++
        if (in_pass[id, home] > longest[home]) longest[home] = in_pass[id, home]
      }
      for (p = 1; p <= 4; p++)
        printf "| tracks in pass %s (rows of the longest) | %d (%d) | 1 |\n", name[p], tracks[p], longest[p]
      printf "| tracks outside of the passes or across several | %d | only the feet in the corner |\n\n", tracks[0]
    }' "$work/people/tracks.csv"
}

# The ball flies towards the rig at about 10 inches a frame: of the tracks that move faster than 5, the longest.
ball_of() {
  local tracks=$1 frames=$2 id path speed rows best=0 ball=
  while read -r id; do
    path=$("$build/tests/score_path" --tracks "$tracks" --frames "$frames" --id "$id" --model ballistic 2>/dev/null) ||
      continue
    speed=$(value speed_a_frame <<<"$path")
    rows=$(value rows <<<"$path")
    if awk -v s="$speed" 'BEGIN {exit !(s > 5)}' && ((rows > best)); then best=$rows ball=$id; fi
  done < <(cut -d, -f2 "$tracks" | sort -nu)
  [[ -n $ball ]] || die "$tracks: no track flies"
  printf '%s\n' "$ball"
}

measure_baseball() {
  local source=$data/baseball_stereo_slow126 pitch first last tracks ball path confirmed
  cat <<END
| pitch | ball visible | first row | confirmed in frame | coverage % (90) | residual x y z, rms, inches | inches a frame |
|---|---|---|---|---|---|---|
END
  while read -r pitch first last; do
    replay "$work/$pitch" "$source/$pitch" --calibration "$source/calibration.yml"
    tracks=$work/$pitch/tracks.csv
    ball=$(ball_of "$tracks" "$first:$last")
    path=$("$build/tests/score_path" --tracks "$tracks" --frames "$first:$last" --id "$ball" --model ballistic)
    # A track's tentative frames are written once it is confirmed: the shortest replay that has rows tells when.
    for ((confirmed = first + 1; confirmed < last; confirmed++)); do
      replay "$work/cut" "$source/$pitch" --calibration "$source/calibration.yml" --frames "1:$confirmed"
      [[ $(awk -F, -v id="$ball" '$2 == id' "$work/cut/tracks.csv") ]] && break
    done
    printf '| %s | %s-%s | %s | %s | %s | %.2f %.2f %.2f | %.1f |\n' "$pitch" "$first" "$last" \
      "$(awk -F, -v id="$ball" '$2 == id {print $1; exit}' "$tracks")" "$confirmed" "$(percent coverage <<<"$path")" \
      "$(value rms_x <<<"$path")" "$(value rms_y <<<"$path")" "$(value rms_z <<<"$path")" \
      "$(value speed_a_frame <<<"$path")"
  done <<<$'one_pitch 5 42\ntwo_pitch 6 43'
  echo
}

measure_eleven() {
  local seed folder
  cat <<END
| seed | HOTA | IDF1 (0.90) | MOTA | IDSW | 3-D error median, m | 95 %, m |
|---|---|---|---|---|---|---|
END
  for seed in ${SEEDS:-1 2 3 4 5}; do
    folder=$work/eleven$seed
    replay "$folder/out" synthetic:eleven --set "synthetic.seed=$seed" --truth "$folder/gt.csv"
    "$stereotrack" eval --truth "$folder/gt.csv" --tracks "$folder/out/tracks.csv" --json >"$folder/eval.json"
    awk -F'[:,]' -v seed="$seed" '
      {gsub(/[" ]/, "", $1); got[$1] = $2}
      END {
        printf "| %s | %.3f | %.3f | %.3f | %d | %.3f | %.3f |\n", seed, got["hota"], got["idf1"], got["mota"],
          got["identity_switches"], got["position_median"], got["position_p95"]
      }' "$folder/eval.json"
    rm -rf "$folder"
  done
  echo
}

measure_middlebury() {
  local preset pair range left right truth scale option other score
  cat <<END
| preset | pair | disparity.max | density % | bad-1 % (valid) | bad-2 % (valid) | bad-2 % (all) |
|---|---|---|---|---|---|---|
END
  for preset in robust thesis; do
    while read -r pair range left right truth scale option other; do
      quiet "$stereotrack" disparity "$data/middlebury_stereo/$pair/$left" "$data/middlebury_stereo/$pair/$right" \
        --config "$root/config/presets/$preset.toml" --set "disparity.max=$range" --out "$work/disparity.png"
      score=$("$build/tests/score_disparity" --truth "$data/middlebury_stereo/$pair/$truth" --scale "$scale" \
        "$option" "$data/middlebury_stereo/$pair/$other" --disparity "$work/disparity.png")
      printf '| %s | %s | %s | %s | %s | %s | %s |\n' "$preset" "$pair" "$range" "$(percent density <<<"$score")" \
        "$(percent bad_1 <<<"$score")" "$(percent bad_2 <<<"$score")" "$(percent bad_2_of_all <<<"$score")"
    done <<END | tee "$work/rows"
Cones 64 im2.png im6.png disp2.png 4 --truth-right disp6.png
Teddy 64 im2.png im6.png disp2.png 4 --truth-right disp6.png
Dolls 96 view1.png view5.png disp1.png 3 --truth-right disp5.png
Cloth3 96 view1.png view5.png disp1.png 2 --truth-right disp5.png
Adirondack 96 Adirondack_left.png Adirondack_right.png Adirondack_gt.png 1 --mask Adirondack_mask.png
END
    awk -F'|' -v preset="$preset" '
      {for (i = 5; i <= 8; i++) sum[i] += $i}
      END {
        printf "| %s | **mean** | | %.1f | %.1f | %.1f | %.1f |\n", preset, sum[5] / NR, sum[6] / NR, sum[7] / NR,
          sum[8] / NR
      }
    ' "$work/rows"
  done
  echo
}

measure_highway() {
  local source=$data/cdnet_highway preset score
  cat <<END
| preset | F | precision | recall | shadow pixels kept % |
|---|---|---|---|---|
END
  for preset in robust thesis; do
    quiet "$stereotrack" masks "mono:$source/input" --config "$root/config/presets/$preset.toml" --out "$work/$preset"
    score=$("$build/tests/score_masks" --truth "$source/groundtruth" --masks "$work/$preset")
    printf '| %s | %.3f | %.3f | %.3f | %s |\n' "$preset" "$(value f_measure <<<"$score")" \
      "$(value precision <<<"$score")" "$(value recall <<<"$score")" "$(percent shadow_rate <<<"$score")"
  done
  echo
}

# Frames left out at the start are those that the scene's header names. The stock subtractors see the left pictures.
measure_scenes() {
  local scene skip seed method folder score
  cat <<END
| scene | seed | method | F | precision | recall | shadow pixels kept % |
|---|---|---|---|---|---|---|
END
  while read -r scene skip; do
    for seed in ${SEEDS:-1 2}; do
      folder=$work/$scene$seed
      quiet "$stereotrack" synth "$scene" --seed "$seed" --frames 400 --out "$folder"
      for method in robust thesis knn mog2; do
        if [[ $method == robust || $method == thesis ]]; then
          quiet "$stereotrack" masks "$folder" --config "$root/config/presets/$method.toml" --out "$folder/$method"
        else
          quiet "$build/tests/opencv_masks" --method "$method" --pictures "$folder/left" --out "$folder/$method"
        fi
        score=$("$build/tests/score_masks" --truth "$folder/masks" --masks "$folder/$method" --skip "$skip" --offset 0)
        printf '| %s | %s | %s | %.3f | %.3f | %.3f | %s |\n' "$scene" "$seed" "$method" "$(value f_measure <<<"$score")" \
          "$(value precision <<<"$score")" "$(value recall <<<"$score")" "$(percent shadow_rate <<<"$score")"
      done
      rm -rf "$folder"
    done
  done <<END
foliage 30
shake 30
occupied 0
exposure_step 30
END
  echo
}

# Scores of one tracks file as a row. The scenes' cameras have f = 600 px and b = 0.25 m.
tracking_row() {
  local scene=$1 seed=$2 method=$3 truth=$4 tracks=$5 frames=$6
  "$stereotrack" eval --truth "$truth" --tracks "$tracks" --frames "$frames" --focal-baseline 150 --json |
    awk -F'[:,]' -v head="| $scene | $seed | $method" '
      {gsub(/[" ]/, "", $1); gsub(/ /, "", $2); got[$1] = $2}
      function real(key, digits, by) {return got[key] == "null" ? "-" : sprintf("%.*f", digits, by * got[key])}
      END {
        printf "%s | %.3f | %.3f | %d | %.3f | %.2f | %s | %s | %s |\n", head, got["hota"], got["idf1"],
          got["identity_switches"], got["mota"], got["false_tracks_a_minute"], real("position_median", 3, 1),
          real("position_geometry_median", 2, 1), real("velocity_median", 1, 100)
      }'
}

# One configuration for all, the default, and beside it what an afternoon with OpenCV gives.
measure_tracking() {
  local scene frames seed folder
  cat <<END
| scene | seed | tracker | HOTA | IDF1 | IDSW | MOTA | false tracks a minute | 3-D error median, m | over 1/4 px | velocity error median, % |
|---|---|---|---|---|---|---|---|---|---|---|
END
  while read -r scene frames; do
    [[ " ${SCENES:-$scene} " == *" $scene "* ]] || continue
    for seed in ${SEEDS:-1 2 3}; do
      folder=$work/$scene$seed
      quiet "$stereotrack" synth "$scene" --seed "$seed" --frames "$frames" --out "$folder"
      rm -rf "$folder/masks" "$folder/disparity"
      replay "$folder/out" "$folder"
      tracking_row "$scene" "$seed" stereotrack "$folder/gt.csv" "$folder/out/tracks.csv" "$frames"
      quiet "$build/tests/opencv_tracker" "$folder" --calibration "$folder/calibration.yml" --out "$folder/opencv.csv"
      tracking_row "$scene" "$seed" opencv "$folder/gt.csv" "$folder/opencv.csv" "$frames"
      rm -rf "$folder"
    done
  done <<END
eleven 600
crossing 660
stop-and-go 1170
crowd 600
far 600
fast 660
dropout 600
flicker 3600
dark 3600
foliage 3600
shake 3600
END
  echo
}

for section in "${sections[@]}"; do
  case $section in
    conveyor | people | baseball | eleven | middlebury | highway | scenes | tracking) ;;
    *) die "no section $section" 2 ;;
  esac
  [[ $section == eleven || $section == scenes || $section == tracking || -d $data ]] ||
    die "$data: no recordings there; give their folder as DATA_DIR"
  "measure_$section"
done
