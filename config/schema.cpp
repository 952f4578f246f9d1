#include "config/schema.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "config/presets.hpp"
#include "config/signals.hpp"

namespace stereotrack::config {
namespace {

/// ADDR:PORT, NAME:PORT or [ADDR6]:PORT.
std::string check_destination(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  const std::string_view host = text.substr(0, colon == std::string_view::npos ? 0 : colon);
  const std::string_view port = colon == std::string_view::npos ? std::string_view() : text.substr(colon + 1);
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  const bool host_good = !host.empty() && host.find_first_of(" \t/") == std::string_view::npos &&
                         (bracketed || host.find_first_of("[]:") == std::string_view::npos);
  const bool digits =
      !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string_view::npos;
  const int number = digits ? std::stoi(std::string(port)) : 0;
  if (host_good && number >= 1 && number <= 65535) return {};
  return quoted(text) + " is not ADDR:PORT: write it like \"192.168.1.10:9000\" or \"[fe80::1]:9000\"";
}

/// A line that may be left out.
std::string check_line_or_none(std::string_view text) { return text.empty() ? std::string() : check_line(text); }

void add_thread(std::vector<Key>& keys, const std::string& thread, ThreadConfig& config, std::string_view does) {
  keys.push_back(key("thread." + thread + ".priority", config.priority, 0, 99, "",
                     "Real-time priority of the thread that " + std::string(does) +
                         "; 0: the ordinary scheduler. Kernel threads for interrupts have 50."));
  keys.push_back(key("thread." + thread + ".core", config.core, -1, 1023, "", "The core it is bound to; -1: any."));
}

}  // namespace

std::vector<Key> keys_of(Configuration& c) {
  PipelineConfig& p = c.pipeline;
  std::vector<Key> keys = {
      key("preset", c.preset, preset_names(), "Which preset gives the values that are not given here."),

      key("source.name", c.source.name, nullptr,
          "What stereotrackd watches: cameras, those of camera.left and camera.right; or, into memory at start and "
          "played in real time, synthetic:NAME or a recording. stereotrack is told its source on the command line."),
      key("source.repeat", c.source.repeat,
          {{"bounce", Repeat::kBounce}, {"loop", Repeat::kLoop}, {"once", Repeat::kOnce}},
          "At the end of what stereotrackd plays from memory: go backwards, begin anew, or end."),
      key("source.memory_mb", c.source.memory_mb, 1, 1048576, "MB",
          "Most memory that what is played may take; more is refused at start."),
      key("source.fps", c.source.fps, 0.1, 1000, "1/s",
          "Pairs per second, used only where the source itself has no times: every speed follows from it."),
      key("source.flip", c.source.flip, "Turns both views top to bottom, for cameras that hang upside down."),
      key("source.swap", c.source.swap,
          "Exchanges the left and the right view, for recordings that name them the other way round."),
      key("source.shift_rows", c.source.shift_rows, -100, 100, "px",
          "Rows that the right picture is moved down (negative: up), for video files whose views were cut at different "
          "heights."),

      key("camera.driver", c.camera.driver, {{"v4l2", CameraDriver::kV4l2}, {"libcamera", CameraDriver::kLibcamera}},
          "Whose cameras they are: the kernel's, Video4Linux 2; or libcamera's, through a module that is loaded at run "
          "time."),
      key("camera.left.device", c.camera.left.device, nullptr,
          "The left camera, for source.name = \"cameras\": /dev/video0, a link to it that does not change with the "
          "order of plugging in (/dev/v4l/by-path/...), or bus:NAME, name:CARD; of libcamera its id, its place in the "
          "list from 0, or a part that only its id or model has."),
      key("camera.left.sensor", c.camera.left.sensor, nullptr,
          "Its sensor's name, or how it begins, where the driver has the program connect the camera's parts (media "
          "controller) and there are several; empty: the one that is connected, or the nearest. Not with libcamera."),
      key("camera.right.device", c.camera.right.device, nullptr, "The right one; empty: one camera, in mono."),
      key("camera.right.sensor", c.camera.right.sensor, nullptr, "Likewise."),
      key("camera.side_by_side", c.camera.side_by_side,
          "One device with two eyes: the left camera's picture holds both views, the left one beside the right one."),
      key("camera.width", c.camera.width, 16, 8192, "px",
          "Width of the pictures of each camera; of both views with camera.side_by_side."),
      key("camera.height", c.camera.height, 16, 8192, "px", "Height of them."),
      key("camera.format", c.camera.format, nullptr,
          "How pictures lie in memory, such as grey8, yuyv, nv12, rggb10p; auto: grey, else what is cheapest to read."),
      key("camera.fps", c.camera.fps, 0.1, 1000, "1/s", "Frames a second of each camera, and pulses of its trigger."),
      key("camera.buffers", c.camera.buffers, 6, 32, "",
          "Buffers of each camera: four pairs may be on their way, two are the driver's, the others let frames wait "
          "for their partners."),
      key("camera.memory", c.camera.memory, {{"mmap", CameraMemory::kMmap}, {"dmabuf", CameraMemory::kDmabuf}},
          "Whose memory frames lie in: the driver's, mapped; or dma-bufs, whose caches are cleaned around each frame, "
          "where mapped memory is slow to read: the driver's, or those of camera.heap."),
      key("camera.heap", c.camera.heap, nullptr,
          "With dmabuf: a device that gives the memory, such as /dev/dma_heap/system, /dev/dma_heap/linux,cma for "
          "cameras that want it in one piece, or /dev/udmabuf; empty: the camera's driver does."),
      key("camera.exposure_us", c.camera.exposure_us, 0, 1e7, "us", "Exposure of both; 0: automatic, each by itself."),
      key("camera.gain", c.camera.gain, 0, 1000, "", "Gain of both, 1 is none; 0: automatic, each by itself."),
      key("camera.black_level", c.camera.black_level, -1, 65535, "",
          "Black level of both in the driver's own unit; -1: as the driver has it. Not with libcamera."),
      key("camera.control_delay_frames", c.camera.control_delay_frames, 1, 8, "frames",
          "From a change of exposure or gain to the first frame that was exposed with it, as the sensor's data sheet "
          "has it: what each pair is told to be exposed with. V4L2 alone; libcamera tells it of each frame."),
      key("camera.readout_us", c.camera.readout_us, 0, 1e7, "us",
          "From the end of an exposure to the end of its frame, where the driver stamps the latter; 0: as it tells. "
          "Required where it does not tell."),
      key("camera.timeout_ms", c.camera.timeout_ms, 10, 60000, "ms",
          "A camera that is silent for longer, once a frame has come, is given up and opened anew; four periods at "
          "least. Without the right one it goes on in mono."),
      key("camera.tolerance", c.camera.tolerance, 0.001, 0.5, "period",
          "Left and right pictures exposed this near to each other are a pair; 0.5 for cameras that nobody "
          "synchronises."),
      key("camera.steer", c.camera.steer,
          "With trigger.mode = \"free-run\", and where the right camera's driver allows: its rate is held to the left "
          "one's, so that both expose together. False: phase and drift are only told."),
      key("camera.skew_limit_ms", c.camera.skew_limit_ms, 0, 1000, "ms",
          "A pair whose exposures are further apart raises an alarm in health; 0: none does."),
      key("camera.exposure_limit_percent", c.camera.exposure_limit_percent, 0, 100, "%",
          "Exposures of a pair that differ by more of the longer one raise an alarm in health; 0: none do."),

      key("trigger.mode", c.trigger.mode,
          {{"free-run", TriggerMode::kFreeRun},
           {"unseen", TriggerMode::kUnseen},
           {"gpio", TriggerMode::kGpio},
           {"pwm", TriggerMode::kPwm},
           {"external", TriggerMode::kExternal}},
          "Who asks the cameras for exposures: nobody, each runs by itself; somebody who does not tell us, such as "
          "wires between the cameras; we, by the pulses of a line or of hardware PWM; somebody whose edges a line "
          "shows us. With all but the first, that neither camera gives frames is told and no fault of theirs; "
          "docs/CAMERAS.md."),
      key("trigger.line", c.trigger.line, check_line_or_none,
          "CHIP:LINE, as a signal's: driven with gpio, read with external; camera.fps pulses a second either way."),
      active_key("trigger.active", c.trigger.active, "Level of the line, or of the PWM output, when it is active."),
      key("trigger.edge", c.trigger.edge, {{"rising", InputEdge::kRising}, {"falling", InputEdge::kFalling}},
          "Which edge begins an exposure: becoming active, or inactive."),
      bias_key("trigger.bias", c.trigger.bias,
               "With external: what the chip holds the line's level with where nothing drives it; not every chip can."),
      key("trigger.pulse_us", c.trigger.pulse_us, 1, 1e7, "us",
          "How long the line, or the PWM output, is active for one exposure."),
      key("trigger.delay_us", c.trigger.delay_us, 0, 1e7, "us",
          "From the edge to the beginning of the exposure, with gpio and external: frames are matched with pulses by "
          "it, within camera.tolerance."),
      key("trigger.late_us", c.trigger.late_us, 10, 1e6, "us",
          "With gpio: a pulse that the thread would begin later than this after its time is skipped and counted, for "
          "it slept."),
      key("trigger.pwm_chip", c.trigger.pwm_chip, nullptr,
          "With pwm: the chip in /sys/class/pwm, as pwmchip0, or by the name of its device, such as fe20c000.pwm, "
          "which does not change with the order of drivers."),
      key("trigger.pwm_channel", c.trigger.pwm_channel, 0, 255, "", "Its channel."),

      key("synthetic.seed", c.synthetic.seed, 0, 4294967295.0, "",
          "Which drawing of the scene synthetic:NAME shows; no other source looks at this section."),
      key("synthetic.frames", c.synthetic.frames, 1, 100000, "frames", "How many pairs synthetic:NAME gives."),
      key("synthetic.width", c.synthetic.width, 64, 4096, "px", "Width of its pictures."),
      key("synthetic.height", c.synthetic.height, 48, 3072, "px", "Height of its pictures."),

      key("latency.output_ms", c.latency.output_ms, 1, 10000, "ms",
          "Time from the middle of the exposure to the moment its result is sent: longer misses fewer deadlines, "
          "shorter predicts less."),
      key("latency.lead_ms", c.latency.lead_ms, 0, 1000, "ms",
          "How long before that moment the publisher decides what leaves, predicts and encodes it: a result that comes "
          "later is late."),
      key("latency.awake_ms", c.latency.awake_ms, 0, 10, "ms",
          "The publisher is awake for the last part of its wait, so that what the kernel takes to wake it does not "
          "make the result late; costs that much of a core."),
      key("latency.late_ms", c.latency.late_ms, 0.01, 1000, "ms",
          "What leaves later than its moment by more has missed its deadline: counted, and a reason to record."),
      key("latency.grace_ms", c.latency.grace_ms, 0, 1000, "ms",
          "How long after that moment a result may still leave, flagged, when the publisher was kept from running."),
      key("latency.stale_ms", c.latency.stale_ms, 0, 60000, "ms",
          "When no result comes, targets go on as predicted for so long beyond output_ms; then none leaves."),
      key("latency.missing_limit", c.latency.missing_limit, 1, 100000, "pairs",
          "So many pairs in a row that do not come are told, one by one; then status alone, until one comes."),

      key("realtime.mode", c.realtime.mode,
          {{"enforce", RealTimeMode::kEnforce}, {"try", RealTimeMode::kTry}, {"off", RealTimeMode::kOff}},
          "Where a right that real time needs is missing: refuse to start, say so and go on, or ask for none."),
      key("realtime.deep_sleep", c.realtime.deep_sleep,
          "Lets cores sleep as deeply as they like: saves power, and wakes up to milliseconds late."),

      key("shed.order", c.shed.order, nullptr,
          "What is left out when the time runs out, first to go first; what is not named never is."),
      key("shed.above", c.shed.above, 0.01, 1, "budget",
          "Part of the time that there is from which a frame is heavy; one that takes all of it sheds at once."),
      key("shed.below", c.shed.below, 0.01, 1, "budget", "Part of it under which a frame is light."),
      key("shed.after_frames", c.shed.after_frames, 1, 10000, "frames", "Heavy frames in a row that shed one more."),
      key("shed.restore_frames", c.shed.restore_frames, 1, 100000, "frames",
          "Light frames in a row that bring one back, on trial: each trial that fails doubles them."),

      key("metrics.listen", c.metrics.listen, nullptr,
          "ADDR:PORT where stereotrackd serves its figures as Prometheus text under /metrics; empty: nowhere."),
      key("metrics.file", c.metrics.file, nullptr,
          "File that stereotrackd writes the same text to every second, whole each time; empty: none."),

      key("service.state_directory", c.service.state_directory, nullptr,
          "Where the number of the session is kept; empty: $STATE_DIRECTORY, which systemd sets, else "
          "~/.local/state/stereotrack."),
      key("service.log_targets", c.service.log_targets,
          "A line of the log for each target that is confirmed and each that is gone, with its number in the journal's "
          "field STEREOTRACK_TRACK; 20 lines a second at most, the others are counted in one."),

      key("calibration.file", c.calibration.file, nullptr,
          "Calibration of the rig that stereotrackd watches; a synthetic scene has its own."),

      key("calibration.unit_m", c.calibration.unit_m, 0, 1000, "m per unit of T",
          "Metres in one length unit of the calibration file; 0: as the file's format says (Kalibr, ROS, EuRoC, KITTI: "
          "1), else unknown, and then no rule may be stated in metres."),

      key("telemetry.destinations", c.telemetry.destinations, check_destination,
          "Where the datagrams go over UDP, ADDR:PORT each; empty: nothing is sent."),
      key("telemetry.rig_id", c.telemetry.rig_id, 0, 4294967295.0, "",
          "Number of this rig in every datagram, so that a receiver can tell rigs apart."),
      key("telemetry.key_file", c.telemetry.key_file, nullptr,
          "File with the key that stereotrackd signs its datagrams with, readable by its user alone; empty: they are "
          "not "
          "signed. Replays never are."),
      key("telemetry.multicast_ttl", c.telemetry.multicast_ttl, 1, 255, "hops",
          "How many networks a datagram to a multicast address may cross; 1: it stays in the local one."),

      zones_key(c.zones),
      signals_key(c.signals),
      inputs_key(c.inputs),

      key("record.on", c.record.on,
          "Keeps the last seconds in memory and writes them to a recording when something happens."),
      key("record.seconds", c.record.seconds, 0.1, 600, "s",
          "Time before it that a recording has: at least half of it is replayed exactly. Costs memory: each frame its "
          "pictures' bytes."),
      key("record.seconds_after", c.record.seconds_after, 0, 600, "s", "Time after it that a recording has."),
      key("record.reduce", c.record.reduce, 1, 4, "",
          "Recorded pictures are so many times smaller along rows and columns: over 1 they hold luma alone, and a "
          "replay is not the run's to the byte any more."),
      key("record.every", c.record.every, 1, 100, "frames",
          "Every n-th frame is recorded: over 1, a replay is not the run's to the byte any more."),
      key("record.directory", c.record.directory, nullptr,
          "Folder for recordings, on a disk that bears the writing; empty: recordings in the state directory."),
      key("record.max_mb", c.record.max_mb, 1, 1000000, "MB",
          "All recordings in it together: where there are more, the oldest are deleted."),
      key("record.on_deadline", c.record.on_deadline, "Records when a result was not there in time."),
      key("record.on_zone", c.record.on_zone, "Records when a target comes into a zone."),
      key("record.on_signal", c.record.on_signal, "Records when the service is sent SIGUSR1."),
      key("record.on_input", c.record.on_input, "Records when an [[input]] line has an edge."),

      key("equalise.mode", p.equalise,
          {{"off", EqualiseMode::kOff}, {"frame", EqualiseMode::kFrame}, {"frozen", EqualiseMode::kFrozen}},
          "Histogram equalisation (3.2-3.5): frame by frame makes the background flicker, frozen keeps the first "
          "table."),

      key("background.method", p.background.method,
          {{"adaptive", ForegroundMethod::kAdaptive}, {"edges", ForegroundMethod::kEdges}},
          "How foreground is found: by an adaptive background, or by the document's mean, difference and edges."),
      key("background.frames", p.background.frames, 1, 10000, "frames",
          "Frames whose mean is the background (3.7); until then the mean of those seen, flagged as learning."),
      key("background.window", p.background.adaptive.window, 2, 1024, "frames",
          "Memory of the adaptive background: longer is steadier, shorter follows the light faster."),
      key("background.pull", p.background.adaptive.pull, 0, 8, "mean deviations",
          "With one view alone: how far a picture pulls a pixel's mean and noise at most. Lower keeps dense traffic "
          "out of them, higher calms leaves; 0: without bound, as always with two views."),
      key("background.absorb_frames", p.background.adaptive.absorb_frames, 2, 60000, "frames",
          "What stands still for so long becomes background; sooner where that was seen for less, but for what stereo "
          "shows to stand before it."),
      key("background.noise_floor", p.background.adaptive.noise_floor, 1, 4096, "1/256 grey level",
          "Added to each pixel's measured noise: higher finds less in the dark and in clean pictures."),
      key("background.edge_percent", p.background.adaptive.edge_percent, 0, 200, "%",
          "Motion of background edges that is tolerated, in percent of a pixel: higher calms shaking masts."),
      key("background.relearn_percent", p.background.adaptive.relearn_percent, 1, 100, "%",
          "When more of the picture changes at once, it is light, not motion: the background starts anew, flagged."),

      key("foreground.low_sd", p.foreground.low_sd, 0.5, 60, "sd",
          "Distance from the background from which a pixel may belong to an object."),
      key("foreground.faint_sd", p.foreground.faint_sd, 0.5, 60, "sd",
          "And the same, as the mean of 5x5 pixels: large faint parts of an object."),
      key("foreground.high_sd", p.foreground.high_sd, 0.5, 60, "sd",
          "Distance that some pixels of an object must reach."),
      key("foreground.halo_percent", p.foreground.halo_percent, 0, 90, "%",
          "Pixels weaker than this part of a strong neighbour are its blur, not object: higher gives tighter boxes."),
      key("foreground.min_seeds", p.foreground.min_seeds, 1, 10000, "px", "Pixels over high_sd that an object needs."),

      key("shape.edge_threshold", p.shape.edge_threshold, 1, 255, "grey levels",
          "Edge strength from which a pixel is an edge (3.12); only with background.method = edges."),
      key("shape.opening", p.shape.opening, 0, 10, "passes", "3x3 openings (3.13): more removes larger specks."),
      key("shape.closing", p.shape.closing, 0, 10, "passes", "3x3 closings: more bridges wider gaps in an object."),
      key("shape.hole_px", p.shape.hole_px, 0, 1000000, "px", "Holes up to this area are filled."),
      key("shape.max_blobs", p.shape.max_blobs, 1, 1024, "", "Regions that are looked at; of more, the largest."),
      key("shape.min_blob_px", p.shape.min_blob_px, 1, 1000000, "px", "Smaller regions are not looked at."),
      key("level_set.on", p.shape.level_set, "Refines each region from its hull by the level set."),
      key("level_set.iterations", p.shape.level_set_config.max_iterations, 0, 1000, "",
          "Most iterations of the level set: bounds its cost."),
      key("level_set.margin_px", p.shape.level_set_config.margin_px, 0, 1000, "px",
          "How far the level set may leave a region's box."),
      key("level_set.feature_cap", p.shape.level_set_config.feature_cap, 1, 255, "grey levels",
          "Differences above this count alike: lower keeps dim parts of an object that has bright ones."),
      key("level_set.contour_weight", p.shape.level_set_config.contour_weight, 0, 65025, "grey^2/px",
          "Weight of the contour's length: higher gives smoother outlines."),

      key("disparity.method", p.disparity.method, {{"census", MatchMethod::kCensus}, {"sad", MatchMethod::kSad}},
          "Matching cost: census with checks and sub-pixel, or the document's mean absolute difference."),
      key("disparity.mode", p.disparity.mode, {{"regions", DisparityMode::kRegions}, {"dense", DisparityMode::kDense}},
          "Depth only where something moves, or for the whole picture."),
      key("disparity.max", p.disparity.max, 1, kLargestDisparity, "px", "Largest disparity of the dense map."),
      odd(key("disparity.block", p.disparity.block, 3, 21, "px",
              "Side of the matching window: larger is steadier and rounds corners off. Over 9 (census) or 15 (sad) "
              "there is no vector code: some forty times slower.")),
      key("disparity.reach", p.disparity.reach, 0.05, 1, "width",
          "Largest disparity of a moving region, as a fraction of the picture's width: the nearest distance admitted."),
      key("disparity.small_px", p.disparity.small_px, 0, 1000000, "px",
          "Objects up to this area are matched as a whole, not pixel by pixel."),

      key("shadow.method", p.shadow.method,
          {{"stereo", ShadowMethod::kStereo}, {"chroma", ShadowMethod::kChroma}, {"off", ShadowMethod::kOff}},
          "Shadow test: the background's own disparity first, the document's chroma test alone (3.20-3.23), or none."),
      key("shadow.darkest_percent", p.shadow.test.darkest_percent, 1, 99, "%",
          "Darkest light of a shadow, in percent of the lit background: lower removes deeper shadows, and dark "
          "objects."),
      key("shadow.chroma_tolerance", p.shadow.test.chroma_tolerance, 0, 255, "grey levels",
          "How much a shadow may change Cb and Cr."),
      key("shadow.texture_tolerance", p.shadow.test.texture_tolerance, 0, 255, "grey levels",
          "How much a shadow may change the background's own texture."),
      key("shadow.weak_percent", p.shadow.test.weak_percent, 0, 90, "%",
          "Parts of a region that stand out less than this part of the region do, and show the background's texture, "
          "are its reflection or haze; 0: off."),
      key("shadow.deep", p.shadow.deep,
          "With one view alone: what lies flat at an object's foot and is darker than darkest_percent is shadow, too. "
          "Off "
          "for a camera that looks straight down."),
      key("shadow.disparity_px", p.shadow.test.disparity_px, 0, 16, "px",
          "Disparities this near count as the background's own."),
      key("shadow.own_depth_px", p.shadow.own_depth_px, 0, 16, "px",
          "A region whose disparity is the background's own within this is light or a mark, not an object; 0: off."),

      key("objects.min_area_px", p.objects.min_area_px, 1, 1000000, "px", "Smaller objects are rejected."),
      key("objects.min_area_ppm", p.objects.min_area_ppm, 0, 100000, "1e-6 of the picture",
          "And objects smaller than this part of the picture: 100 is 31 px of 640x480."),
      key("objects.min_size_m", p.zones.min_size_m, 0, kLargestSize_m, "m",
          "Objects whose longer side is shorter are rejected, where their depth is known; 0: none is."),
      key("objects.max_size_m", p.zones.max_size_m, 0, kLargestSize_m, "m",
          "Objects whose longer side is longer are rejected, likewise; 0: none is."),
      key("objects.volume", c.objects.volume, check_zone_or_none,
          "Name of the [[zone]] in space outside of which nothing is tracked, where depth is known; empty: everything "
          "everywhere is."),
      key("objects.merge_gap", p.objects.merge_gap, 0, 2, "size",
          "Gap across which pieces at one depth are one object, as a fraction of the larger one's longer side."),
      key("objects.merge_depth", p.objects.merge_depth, 0, 1, "disparity",
          "Difference in disparity up to which pieces may be one object, as a fraction of the disparity."),
      key("objects.split_depth", p.objects.split_depth, 0.01, 1, "disparity",
          "Gap in disparity that makes two objects of one region, as a fraction of the disparity."),
      key("objects.split_min_px", p.objects.split_min_px, 0.5, 50, "px", "And at least this much."),
      key("objects.split_jump", p.objects.split_jump, 0.005, 1, "disparity",
          "Step in disparity between neighbours that is an edge in depth, as a fraction of the disparity."),
      key("objects.split_part", p.objects.split_part, 0.001, 0.5, "area",
          "Part of a region that a layer of depth needs to be an object."),
      key("objects.most_scatter", p.objects.most_scatter, 0.01, 1, "disparity",
          "Scatter of disparity, as a fraction of it, above which a new object is rejected as inconsistent."),
      key("objects.match_noise_px", p.objects.match_noise_px, 0.02, 5, "px",
          "Standard deviation of one disparity; depth noise follows from it."),

      key("features.corner_quality", p.features.corner_quality, 1, 1000000, "grey^2",
          "Strength from which a corner is followed as a feature."),
      key("features.most_difference", p.features.most_difference, 1, 255, "grey levels",
          "Difference of its patch from which a feature is lost."),
      key("features.search_px", p.features.search_px, 1, 64, "px",
          "Farthest from its prediction that a feature is searched."),

      key("track.confirm_hits", p.track.confirm_hits, 1, 20, "frames", "Detections that confirm a target."),
      key("track.confirm_evidence", p.track.confirm_evidence, 0, 20, "",
          "And the sum of the detections' strengths, 0 to 1 each, that it takes: weak ones need more frames."),
      key("track.tentative_misses", p.track.tentative_misses, 1, 10, "frames",
          "Frames without detection that remove an unconfirmed target."),
      key("track.coast_s", p.track.coast_s, 0, 60, "s", "How long a confirmed target lives on its prediction."),
      key("track.gate", p.track.gate, 1, 10, "sd", "How far from its prediction a target may be found."),
      key("track.acceleration", p.track.acceleration, 0.001, 100, "distance/s^2",
          "Accelerations expected of a target that turns, starts or stops, as a fraction of its distance: higher "
          "follows it at once."),
      key("track.steady_acceleration", p.track.steady_acceleration, 0.001, 100, "distance/s^2",
          "Likewise of one that goes on as it went: lower smooths. What it does is told by how well either fits."),
      key("track.gravity_m_s2", c.track.gravity_m_s2, -1000, 1000, "m/s^2",
          "Gravity as the left rectified camera sees it, to the right, down, forward; [0, 9.81, 0] for a level one. "
          "Given, a target may be one that falls or was thrown, too."),
      key("track.initial_speed", p.track.initial_speed, 0.001, 100, "distance/s",
          "Speeds expected of a new target, as a fraction of its distance."),
      key("track.centre_noise_px", p.track.centre_noise_px, 0.05, 20, "px", "Noise of a box centre."),
      key("track.centre_noise_size", p.track.centre_noise_size, 0, 1, "size",
          "What that noise grows by with the size of the box."),
      key("track.travel_px", p.track.travel_px, 0, 100, "px",
          "Way in the picture before a target is confirmed: tells motion from flicker."),
      key("track.straight_part", p.track.straight_part, 0, 1, "path",
          "Part of its path that this way must be: flicker jumps to and fro."),
  };
  add_thread(keys, "trigger", c.realtime.trigger,
             "gives pulses with trigger.mode = gpio: the highest, it runs for microseconds");
  add_thread(keys, "publisher", c.realtime.publisher, "lets results leave: high, it runs for microseconds");
  add_thread(keys, "capture", c.realtime.capture, "takes frames from the sensors");
  add_thread(keys, "frames", c.realtime.frames, "runs the pipeline");
  add_thread(keys, "service", c.realtime.service,
             "logs, serves figures and feeds the watchdog, and of the one that writes recordings");
  return keys;
}

namespace {

bool is_list(const Key& key) { return key.kind == Kind::kTables; }

std::string section_of(const Key& key) {
  const std::size_t dot = key.name.rfind('.');
  return dot == std::string::npos ? std::string() : key.name.substr(0, dot);
}

std::string leaf_of(const Key& key) { return key.name.substr(key.name.rfind('.') + 1); }

/// The sections in the order of the table; keys without a section first, as TOML demands.
std::vector<std::string> sections_of(const std::vector<Key>& keys) {
  std::vector<std::string> sections{""};
  for (const Key& key : keys) {
    if (std::find(sections.begin(), sections.end(), section_of(key)) == sections.end()) {
      sections.push_back(section_of(key));
    }
  }
  return sections;
}

std::string wrapped_comment(std::string_view text) {
  constexpr std::size_t kWidth = 98;
  std::string out;
  while (text.size() > kWidth) {
    std::size_t cut = text.rfind(' ', kWidth);
    if (cut == std::string_view::npos) cut = kWidth;
    out += "# " + std::string(text.substr(0, cut)) + "\n";
    text.remove_prefix(std::min(text.size(), cut + 1));
  }
  return out + "# " + std::string(text) + "\n";
}

/// The key with its meaning above it.
std::string documented(const Key& key, std::string_view before) {
  const std::string range = range_text(key);
  const std::string limits = range.empty() ? "" : std::string(" Range: ").append(range).append(".");
  std::string text("\n");
  text.append(wrapped_comment(key.doc + limits));
  return text.append(before).append(leaf_of(key)).append(" = ").append(value_text(key)).append("\n");
}

}  // namespace

std::string to_text(const Configuration& configuration) {
  Configuration copy = configuration;
  const std::vector<Key> keys = keys_of(copy);
  std::string text;
  for (const std::string& section : sections_of(keys)) {
    if (!section.empty()) text.append("\n[").append(section).append("]\n");
    for (const Key& key : keys) {
      if (section_of(key) != section || is_list(key)) continue;
      text.append(leaf_of(key)).append(" = ").append(value_text(key)).append("\n");
    }
  }
  for (const Key& list : keys) {
    if (!is_list(list)) continue;
    for (std::size_t i = 0; i < static_cast<std::size_t>(std::get<double>(list.get())); ++i) {
      text.append("\n[[").append(list.name).append("]]\n");
      for (const Key& key : list.keys(i)) {
        text.append(leaf_of(key)).append(" = ").append(value_text(key)).append("\n");
      }
    }
  }
  return text;
}

std::string sample_text() {
  Configuration defaults;
  const std::vector<Key> keys = keys_of(defaults);
  std::string text =
      "# stereotrack: every key with its default.\n"
      "# Written from the table in config/schema.cpp; after a change there run\n"
      "#     cmake --build build/release --target update_sample_config\n"
      "# What a file says wins over the preset, and --set KEY=VALUE wins over the file. So start your own\n"
      "# file empty and copy only the lines that you change: a full copy of this one hides the preset.\n"
      "# Paths of keys are dotted, [source] and fps = 30.0 is the same as source.fps = 30.0.\n"
      "# Lists of tables, [[zone]] and [[signal]], are empty by default: at the end there is one of each, in "
      "comments.\n";
  for (const std::string& section : sections_of(keys)) {
    if (!section.empty()) text.append("\n[").append(section).append("]\n");
    for (const Key& key : keys) {
      if (section_of(key) == section && !is_list(key)) text += documented(key, "");
    }
  }
  for (const Key& list : keys) {
    if (!is_list(list)) continue;
    text.append("\n").append(wrapped_comment(list.doc + " At most " + std::to_string(std::lround(list.max)) + "."));
    text.append("#[[").append(list.name).append("]]\n");
    for (const Key& key : list.example()) text += documented(key, "#");
  }
  return text;
}

}  // namespace stereotrack::config
