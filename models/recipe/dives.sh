#!/usr/bin/env bash
# Renders the dives that the model is trained on, and those that it is tested on: other seeds, scenes and water types.
# Usage: dives.sh FOLDER [path of sfm]
set -euo pipefail
folder=${1:?give a folder for the dives}
sfm=${2:-sfm}
mkdir -p "$folder"

# set scene Jerlov-type depth_m daylight lamp-power radius_m snow_per_m3 seed
dive() {
    local name="$folder/$1/$2-$3-$9"
    [ -f "$name/dive.toml" ] && return
    rm -rf "$name"
    mkdir -p "$folder/$1"
    local motion="arc_deg = 380.0"
    [ "$2" = reef ] && motion="arc_deg = 380.0
radius_m = $7"
    cat >"$folder/$1/scene.toml" <<END
[motion]
$motion
[water]
jerlov = "$3"
depth_m = $4
snow_per_m3 = $8
daylight = $5
[lamps]
power = $6
END
    local cameras=3 frames=10 size=960x600
    [ "$5" = false ] && cameras=2
    [ "$1" = test ] && frames=4 size=1920x1200
    "$sfm" synth "$folder/$1/scene.toml" "$name" --scene "$2" --cameras $cameras --frames $frames --size $size --seed "$9"
}

# Nobody surveys what cannot be seen: in murky water the dives keep near, by night they have the two cameras that look where the lamps shine.
#    set   scene       type depth day lamps radius snow seed
dive train reef        IB   15.0 true  0.6 4.8   30.0 101
dive train reef        I    25.0 true  0.0 6.0   10.0 102
dive train reef        II   12.0 true  0.8 3.8   60.0 103
dive train reef        III  20.0 true  1.0 3.6   60.0 104
dive train reef        1     8.0 true  0.0 3.8   60.0 105
dive train reef        IB   60.0 false 1.5 4.0   40.0 107
dive train reef        II   40.0 false 1.0 3.6  100.0 108
dive train reef        II    5.0 true  0.0 5.5    0.0 110
dive train reef        III  50.0 false 2.0 3.4  100.0 111
dive train reef        IB    3.0 true  0.0 7.0   20.0 112
dive train reef        I    80.0 false 1.0 5.0   20.0 113
dive train reef        1     4.0 true  0.3 3.4   20.0 114
dive train hull        IB   18.0 true  0.4 6.0   30.0 121
dive train hull        II   30.0 true  1.0 6.0   50.0 122
dive train hull        I    12.0 true  0.0 6.0   80.0 123
dive train hull        III  45.0 false 2.0 6.0   60.0 125
dive train hull        I    60.0 false 1.5 6.0   10.0 126
dive train hemispheres IB   10.0 true  0.5 6.0   20.0 131
dive train hemispheres 5     5.0 true  0.0 6.0  100.0 132
dive train hemispheres II   40.0 false 1.0 6.0   60.0 133
dive test  reef        IB   14.0 true  0.6 4.6   30.0 201
dive test  reef        IA   20.0 true  0.3 5.2   20.0 202
dive test  reef        1    10.0 true  0.2 3.7   90.0 203
dive test  reef        IA   70.0 false 1.2 4.2   50.0 205
dive test  pipeline    IB   16.0 true  0.5 6.0   30.0 211
dive test  pipeline    3    35.0 false 1.0 6.0  100.0 212
dive test  pipeline    II   15.0 true  0.0 6.0   50.0 213
dive test  hull        IA   25.0 true  0.6 6.0   40.0 221
dive test  hull        III   8.0 true  0.0 6.0   80.0 222
