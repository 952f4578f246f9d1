#pragma once

/*
 * What lies between stereotrack and libcamera: a table of C functions, which a shared object fills that was built
 * against one libcamera. libcamera changes its binary interface with each release; this table changes with its version
 * alone, so a program of ours goes with any libcamera for which a board has a module.
 *
 * No C++ type crosses it, and no exception. Texts are UTF-8 with a final 0, cut off where they do not fit. Times are
 * nanoseconds. Whoever fills a struct fills all of it. Plain C11, and C++.
 *
 * Threads:  "owner"    open_manager to close_manager, all of a process by one thread at a time; may wait and allocate
 *           "capture"  from start() on, one thread a stream: takes no lock and no heap, never enters libcamera, makes a
 *                      system call at most, which does not wait
 * Threads that a module or its libcamera starts block all signals but those of a fault: the others are the program's,
 * which may not have blocked them yet.
 */

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  kLibcameraModuleVersion = 2,
  kLibcameraTextSize = 256,  /* with the final 0 */
  kLibcameraMostBuffers = 32 /* of a stream */
};

/* The module's own. */
typedef struct LibcameraManager LibcameraManager;
typedef struct LibcameraStream LibcameraStream;

/* What a camera is. */
typedef struct LibcameraFacts {
  char id[kLibcameraTextSize];    /* libcamera's name of it, the same at each start on this board */
  char model[kLibcameraTextSize]; /* of its sensor; its id where libcamera does not say */
  char location[32];              /* "front", "back", "external"; empty: libcamera does not say */
  /* Ranges of its controls; most 0: it has none of that name. */
  int64_t exposure_least, exposure_most;
  int64_t duration_least, duration_most; /* of a frame, in the mode that libcamera would take by itself */
  float gain_least, gain_most;           /* 1 = none */
  uint32_t is_gone;                      /* it was unplugged */
  uint32_t reserved;
} LibcameraFacts;

/* A way in which a camera's pictures can lie in memory, and sizes for it [px]. */
typedef struct LibcameraFormat {
  uint32_t fourcc; /* of DRM, as libcamera's PixelFormat has it */
  uint32_t is_raw; /* comes as the sensor delivers it, past its image processor */
  uint64_t modifier;
  int32_t least_width, least_height;
  int32_t most_width, most_height; /* the same: one size, no range */
} LibcameraFormat;

typedef struct LibcameraWish {
  uint32_t fourcc;
  uint32_t is_raw;
  uint64_t modifier;
  int32_t width, height; /* [px]; 0: libcamera's own choice */
  uint32_t buffers;      /* wanted */
  float gain;            /* 1 = none; 0: automatic */
  int64_t duration;      /* of each frame; 0: libcamera's own choice */
  int64_t exposure;      /* 0: automatic */
} LibcameraWish;

/* What became of it. */
typedef struct LibcameraSetup {
  uint32_t fourcc;
  uint32_t stride; /* bytes from one row to the next */
  uint64_t modifier;
  int32_t width, height; /* [px] */
  uint32_t buffers;
  int32_t descriptor; /* readable while take() would not answer kLibcameraNothing; the module's */
  int64_t duration;   /* that frames are held to; 0: the camera cannot hold them to any */
  int64_t exposure;   /* that is asked of the camera; 0: automatic, or it cannot be set */
  float gain;         /* likewise */
  uint32_t reserved;
} LibcameraSetup;

enum {
  kLibcameraOpened = 0,
  kLibcameraAdjusted = 1, /* libcamera would make something else of format or size: `setup` says what; not opened */
  kLibcameraFailed = 2    /* `why` says why */
};

/* Bits of LibcameraFrame::known. */
enum {
  kLibcameraKnowsStart = 1,    /* sensor_time */
  kLibcameraKnowsStamp = 2,    /* buffer_time */
  kLibcameraKnowsExposure = 4, /* exposure */
  kLibcameraKnowsGain = 8      /* gain */
};

typedef struct LibcameraFrame {
  uint32_t buffer;
  uint32_t sequence; /* libcamera's count */
  uint32_t known;
  uint32_t is_damaged;    /* libcamera does not call it a success */
  uint64_t bytes;         /* that were written; 0: not told */
  int64_t sensor_time;    /* start of the exposure of its first row, on a clock that libcamera leaves open */
  int64_t buffer_time;    /* the kernel driver's stamp: the end of the frame, most often */
  int64_t completed_time; /* when libcamera handed it over, on CLOCK_MONOTONIC */
  int64_t exposure;       /* in force */
  float gain;             /* in force; 1 = none */
  uint32_t reserved;
} LibcameraFrame;

enum { kLibcameraNothing = 0, kLibcameraTaken = 1, kLibcameraLost = 2 };

typedef struct LibcameraModule {
  uint32_t version; /* kLibcameraModuleVersion */
  uint32_t size;    /* of this struct: the same version has the same */
  /* The libcamera that it runs with: "v0.0.3+...". */
  const char* (*library)(void);

  /* ---- Owner. `why` has kLibcameraTextSize bytes. */

  /* Asks the system for cameras; they come and go by themselves then. One a process, and one process at a time: two
     that look for cameras at once find them busy. Null: `why`. */
  LibcameraManager* (*open_manager)(char* why);
  /* No stream is open any more. */
  void (*close_manager)(LibcameraManager* manager);
  /* The last that libcamera complained of while it looked for cameras, in its words; empty: of nothing. Its log is held
     back meanwhile, where nobody has chosen its levels or its file. Lives as long as the manager. */
  const char* (*complaint)(LibcameraManager* manager);

  /* A camera that is wanted is not there. 1: devices were plugged in since the manager was opened, and it may be among
     them: all streams are lost, for another manager has to look, and there is only one at a time. 0: nothing was. */
  int32_t (*renew)(LibcameraManager* manager);

  /* Cameras that there are, or were and are gone; numbers are good until the next call. */
  uint32_t (*count)(LibcameraManager* manager);
  /* 0: there is none of that number. */
  int32_t (*facts)(LibcameraManager* manager, uint32_t camera, LibcameraFacts* facts);
  /* The camera's format of that number, from 0; 0: it has no more. */
  int32_t (*format)(LibcameraManager* manager, uint32_t camera, uint32_t number, LibcameraFormat* format);

  /* kLibcameraOpened: `stream` is to be closed. */
  int32_t (*open)(LibcameraManager* manager, uint32_t camera, const LibcameraWish* wish, LibcameraSetup* setup,
                  LibcameraStream** stream, char* why);
  /* Where a plane of a buffer lies, from its first row on, until the stream is closed. 0: there is no such plane. */
  int32_t (*plane)(LibcameraStream* stream, uint32_t buffer, uint32_t plane, const uint8_t** data, uint64_t* bytes);
  /* Queues all buffers. 0: `why`. Once a stream. */
  int32_t (*start)(LibcameraStream* stream, char* why);
  /* Whatever state it is in; no other thread is in it. Of a camera that was unplugged, libcamera's part stays behind. */
  void (*close)(LibcameraStream* stream);
  /* After kLibcameraLost: what the camera did, and the way out, such as "was unplugged: check its plug and power". Lives
     as long as the stream. */
  const char* (*loss)(LibcameraStream* stream);

  /* ---- Capture */

  /* The oldest frame that waits; its buffer is the caller's until give_back(). */
  int32_t (*take)(LibcameraStream* stream, LibcameraFrame* frame);
  /* It may be filled again: a thread of the module queues it, for libcamera takes locks and memory to do so. */
  void (*give_back)(LibcameraStream* stream, uint32_t buffer);
} LibcameraModule;

/* LIBCAMERA_LOG_LEVELS, which libcamera reads as it is loaded, where nobody has chosen: it tells each start at length
   otherwise. */
#define STEREOTRACK_LIBCAMERA_LOG_LEVELS "*:ERROR"

/* The one symbol of a module: its table, which lives as long as the module does. */
#define STEREOTRACK_LIBCAMERA_ENTRY "stereotrack_libcamera_module"
typedef const LibcameraModule* (*LibcameraEntry)(void);

#ifdef __cplusplus
}
#endif
