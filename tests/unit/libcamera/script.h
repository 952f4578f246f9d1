#pragma once

/* What a test does with the scripted module: it exposes frames, breaks things, and sees what was asked for. */

#include "drivers/capture/libcamera/module.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { kScriptCameras = 2 };

typedef struct ScriptedEye {
  /* Set by the test, before the camera is opened. */
  int32_t refuses_open;   /* busy */
  int32_t adjusts;        /* makes half the width of it */
  int32_t refuses_start;
  int32_t holds_no_rate;
  int32_t has_no_controls;
  int32_t is_gone;
  int32_t splits_planes;  /* of NV12: they lie apart */
  int32_t stride;         /* 0: rows close together */
  uint32_t buffers;       /* 0: what is wanted */
  /* Seen by it. */
  int32_t is_open, is_started;
  uint32_t returned; /* calls of give_back() */
  LibcameraWish wish;
} ScriptedEye;

typedef struct Script {
  int32_t refuses_manager;
  int32_t cameras; /* that there are */
  char complaint[64];
  int32_t managers_opened, managers_closed;
  int32_t plugged_in; /* something was, since: renew() loses all streams */
  ScriptedEye eyes[kScriptCameras];
  void (*reset)(void);
  /* Into a free buffer, each byte of which becomes `shade`; its number, or -1: none is free, the frame is lost.
     frame->buffer is set here. */
  int32_t (*expose)(int32_t camera, LibcameraFrame frame, uint8_t shade);
  /* As it comes, whatever buffer it names. */
  void (*expose_raw)(int32_t camera, LibcameraFrame frame);
  void (*lose)(int32_t camera);
} Script;

typedef Script* (*ScriptEntry)(void);

#ifdef __cplusplus
}
#endif
