/*
 * A module that needs no libcamera: it fills the table in plain C, of which this is the proof, and does what a script
 * (script.h) says. Built several times, with one thing wrong each.
 */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <stdio.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "tests/unit/libcamera/script.h"

#ifndef SCRIPTED_VERSION
#define SCRIPTED_VERSION kLibcameraModuleVersion
#endif
#ifndef SCRIPTED_SIZE
#define SCRIPTED_SIZE sizeof(LibcameraModule)
#endif
#ifndef SCRIPTED_TABLE
#define SCRIPTED_TABLE (&kTable)
#endif
#define VISIBLE __attribute__((visibility("default")))

#ifdef SCRIPTED_LACKS
/* As a module whose libcamera has changed. */
extern int symbol_of_another_libcamera(void);
#endif

enum { kFourccR8 = 0x20203852, kFourccNv12 = 0x3231564E, kRing = 64 };

struct LibcameraManager {
  int unused;
};

struct LibcameraStream {
  int camera;
  LibcameraSetup setup;
  uint8_t* memory[kLibcameraMostBuffers];
  uint64_t bytes;
  int is_free[kLibcameraMostBuffers];
  LibcameraFrame ring[kRing];
  int written, taken;
  int lost;
};

static Script script;
static LibcameraStream* streams[kScriptCameras];
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;

static void ring_bell(LibcameraStream* s) {
  const uint64_t one = 1;
  (void)!write(s->setup.descriptor, &one, sizeof one);
}

static void put(LibcameraStream* s, const LibcameraFrame* frame) {
  s->ring[s->written++ % kRing] = *frame;
  ring_bell(s);
}

static int32_t expose(int32_t camera, LibcameraFrame frame, uint8_t shade) {
  pthread_mutex_lock(&mutex);
  LibcameraStream* s = streams[camera];
  int32_t found = -1;
  if (s != NULL && script.eyes[camera].is_started && !s->lost) {
    for (uint32_t i = 0; i < s->setup.buffers && found < 0; ++i) {
      if (s->is_free[i]) found = (int32_t)i;
    }
  }
  if (found >= 0) {
    s->is_free[found] = 0;
    memset(s->memory[found], shade, s->bytes);
    frame.buffer = (uint32_t)found;
    put(s, &frame);
  }
  pthread_mutex_unlock(&mutex);
  return found;
}

static void expose_raw(int32_t camera, LibcameraFrame frame) {
  pthread_mutex_lock(&mutex);
  put(streams[camera], &frame);
  pthread_mutex_unlock(&mutex);
}

static void lose(int32_t camera) {
  pthread_mutex_lock(&mutex);
  streams[camera]->lost = 1;
  ring_bell(streams[camera]);
  pthread_mutex_unlock(&mutex);
}

static void reset(void) {
  memset(&script, 0, sizeof script);
  script.cameras = kScriptCameras;
  script.reset = reset;
  script.expose = expose;
  script.expose_raw = expose_raw;
  script.lose = lose;
}

static const char* library(void) { return "v9.1-scripted"; }

static LibcameraManager* open_manager(char* why) {
  if (script.refuses_manager) {
    strcpy(why, "does not start to look for cameras (scripted)");
    return NULL;
  }
  ++script.managers_opened;
  script.plugged_in = 0;
  return calloc(1, sizeof(LibcameraManager));
}

static void close_manager(LibcameraManager* manager) {
  ++script.managers_closed;
  free(manager);
}

static const char* complaint(LibcameraManager* manager) {
  (void)manager;
  return script.complaint;
}

static int32_t renew(LibcameraManager* manager) {
  (void)manager;
  if (!script.plugged_in) return 0;
  for (int i = 0; i < kScriptCameras; ++i) {
    if (streams[i] != NULL) lose(i);
  }
  return 1;
}

static uint32_t count(LibcameraManager* manager) {
  (void)manager;
  return (uint32_t)script.cameras;
}

static int32_t facts(LibcameraManager* manager, uint32_t camera, LibcameraFacts* out) {
  (void)manager;
  if (camera >= (uint32_t)script.cameras) return 0;
  memset(out, 0, sizeof *out);
  snprintf(out->id, sizeof out->id, "/base/i2c@%u/imx219@10", camera);
  strcpy(out->model, "imx219");
  strcpy(out->location, "external");
  out->is_gone = (uint32_t)script.eyes[camera].is_gone;
  if (script.eyes[camera].has_no_controls) return 1;
  out->exposure_least = 100000;
  out->exposure_most = 20000000;
  out->duration_least = 10000000;
  out->duration_most = 1000000000;
  out->gain_least = 1.0F;
  out->gain_most = 8.0F;
  return 1;
}

static int32_t format(LibcameraManager* manager, uint32_t camera, uint32_t number, LibcameraFormat* out) {
  static const LibcameraFormat kFormats[] = {
      {kFourccNv12, 0, 0, 16, 4, 1920, 1080},
      {0x41414270 /* pBAA */, 1, 0x123, 640, 480, 640, 480},
      {kFourccR8, 1, 0, 640, 480, 640, 480},
      {kFourccR8, 1, 0, 1280, 800, 1280, 800},
  };
  (void)manager;
  if (camera >= (uint32_t)script.cameras || number >= sizeof kFormats / sizeof kFormats[0]) return 0;
  *out = kFormats[number];
  return 1;
}

static void close_stream(LibcameraStream* s) {
  pthread_mutex_lock(&mutex);
  script.eyes[s->camera].is_open = script.eyes[s->camera].is_started = 0;
  streams[s->camera] = NULL;
  close(s->setup.descriptor);
  for (uint32_t i = 0; i < s->setup.buffers; ++i) free(s->memory[i]);
  free(s);
  pthread_mutex_unlock(&mutex);
}

static int64_t clamp(int64_t value, int64_t least, int64_t most) {
  return value < least ? least : value > most ? most : value;
}

static int32_t open_stream(LibcameraManager* manager, uint32_t camera, const LibcameraWish* wish, LibcameraSetup* setup,
                           LibcameraStream** out, char* why) {
  ScriptedEye* eye = &script.eyes[camera];
  (void)manager;
  eye->wish = *wish;
  if (eye->refuses_open || eye->is_open) {
    strcpy(why, "is not to be had (busy): another program has it");
    return kLibcameraFailed;
  }
  memset(setup, 0, sizeof *setup);
  setup->fourcc = wish->fourcc;
  setup->modifier = wish->modifier;
  setup->width = wish->width > 0 ? wish->width : 640;
  setup->height = wish->height > 0 ? wish->height : 480;
  if (eye->adjusts) {
    setup->width /= 2;
    return kLibcameraAdjusted;
  }
  setup->buffers = eye->buffers > 0 ? eye->buffers : wish->buffers;
  setup->stride = (uint32_t)(eye->stride > 0 ? eye->stride : setup->width);
  setup->descriptor = eventfd(0, EFD_SEMAPHORE | EFD_NONBLOCK | EFD_CLOEXEC);
  if (!eye->holds_no_rate && wish->duration > 0) setup->duration = clamp(wish->duration, 10000000, 1000000000);
  if (!eye->has_no_controls) {
    if (wish->exposure > 0) setup->exposure = clamp(wish->exposure, 100000, 20000000);
    if (wish->gain > 0) setup->gain = wish->gain < 1 ? 1 : wish->gain > 8 ? 8 : wish->gain;
  }
  LibcameraStream* s = calloc(1, sizeof *s);
  s->camera = (int)camera;
  s->setup = *setup;
  s->bytes = (uint64_t)setup->stride * (uint64_t)setup->height * 2;
  for (uint32_t i = 0; i < setup->buffers; ++i) s->memory[i] = calloc(1, s->bytes);
  pthread_mutex_lock(&mutex);
  streams[camera] = s;
  eye->is_open = 1;
  pthread_mutex_unlock(&mutex);
  *out = s;
  return kLibcameraOpened;
}

static int32_t plane(LibcameraStream* s, uint32_t buffer, uint32_t number, const uint8_t** data, uint64_t* bytes) {
  const uint64_t first = (uint64_t)s->setup.stride * (uint64_t)s->setup.height;
  const int is_nv12 = s->setup.fourcc == kFourccNv12;
  if (buffer >= s->setup.buffers || number > (is_nv12 ? 1U : 0U)) return 0;
  *data = s->memory[buffer] + (number == 0 ? 0 : first + (script.eyes[s->camera].splits_planes ? 16 : 0));
  *bytes = number == 0 ? first : first / 2;
  return 1;
}

static int32_t start(LibcameraStream* s, char* why) {
  if (script.eyes[s->camera].refuses_start) {
    strcpy(why, "does not start to stream (scripted)");
    return 0;
  }
  pthread_mutex_lock(&mutex);
  script.eyes[s->camera].is_started = 1;
  for (uint32_t i = 0; i < s->setup.buffers; ++i) s->is_free[i] = 1;
  pthread_mutex_unlock(&mutex);
  return 1;
}

static const char* loss(LibcameraStream* s) {
  (void)s;
  return "was unplugged: check its plug and power";
}

static int32_t take(LibcameraStream* s, LibcameraFrame* frame) {
  int32_t outcome = kLibcameraNothing;
  pthread_mutex_lock(&mutex);
  if (s->taken < s->written) {
    uint64_t one = 0;
    (void)!read(s->setup.descriptor, &one, sizeof one);
    *frame = s->ring[s->taken++ % kRing];
    outcome = kLibcameraTaken;
  } else if (s->lost) {
    outcome = kLibcameraLost;
  }
  pthread_mutex_unlock(&mutex);
  return outcome;
}

static void give_back(LibcameraStream* s, uint32_t buffer) {
  pthread_mutex_lock(&mutex);
  memset(s->memory[buffer], 0xEE, s->bytes);
  s->is_free[buffer] = 1;
  ++script.eyes[s->camera].returned;
  pthread_mutex_unlock(&mutex);
}

VISIBLE Script* the_script(void) {
  if (script.reset == NULL) reset();
  return &script;
}

#ifdef SCRIPTED_NO_ENTRY
#define stereotrack_libcamera_module another_entry
#endif
VISIBLE const LibcameraModule* stereotrack_libcamera_module(void);
VISIBLE const LibcameraModule* stereotrack_libcamera_module(void) {
  static const LibcameraModule kTable = {SCRIPTED_VERSION, SCRIPTED_SIZE, library, open_manager, close_manager,
                                         complaint,        renew,         count,   facts,        format,
                                         open_stream,      plane,         start,   close_stream, loss,
                                         take,             give_back};
#ifdef SCRIPTED_LACKS
  (void)symbol_of_another_libcamera();
#endif
  (void)the_script();
  return SCRIPTED_TABLE;
}
