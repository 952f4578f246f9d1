// A plugin for qemu-aarch64 that counts the instructions between two marks of the program it runs. It counts what was
// begun of a block of translated code that ends in a branch or a system call: exact, and the same twice.
//
//     qemu-aarch64 -plugin libqemu_count.so,out=FILE PROGRAM...
//
// A mark is a system call that no kernel has (tests/bench/mark.hpp): whatever ran since the last mark is credited to
// the number that the mark gives; number 0 is nobody's. FILE has a line a number: NUMBER MARKS INSTRUCTIONS SIMD
// MEMORY. SIMD are the instructions of the vector and floating point units, MEMORY loads and stores of either register
// file. Sums hold for programs that run one thread between their marks.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "qemu-plugin.h"

QEMU_PLUGIN_EXPORT int qemu_plugin_version = QEMU_PLUGIN_VERSION;

enum { kMarkCall = 0x7354, kMostMarks = 256 };

struct Counts {
  uint64_t all;
  uint64_t simd;
  uint64_t memory;
};

static struct Counts now;
static struct Counts last;
static struct Counts sums[kMostMarks];
static uint64_t marks[kMostMarks];
static const char* out_path;

static void block_runs(unsigned int cpu, void* data) {
  const struct Counts* block = data;
  (void)cpu;
  now.all += block->all;
  now.simd += block->simd;
  now.memory += block->memory;
}

static uint32_t word_of(const struct qemu_plugin_insn* insn) {
  uint32_t word = 0;
#if QEMU_PLUGIN_VERSION >= 3
  (void)qemu_plugin_insn_data(insn, &word, sizeof word);
#else
  memcpy(&word, qemu_plugin_insn_data(insn), sizeof word);
#endif
  return word;
}

// Once for each block; QEMU keeps blocks as long as the process, and so do we.
static void block_is_translated(qemu_plugin_id_t id, struct qemu_plugin_tb* tb) {
  struct Counts* block = calloc(1, sizeof *block);
  (void)id;
  if (block == NULL) abort();
  block->all = qemu_plugin_tb_n_insns(tb);
  for (size_t i = 0; i < block->all; ++i) {
    // Arm Architecture Reference Manual, A64 instruction set encoding, op0: bits 28 to 25.
    const uint32_t op0 = (word_of(qemu_plugin_tb_get_insn(tb, i)) >> 25) & 0xF;
    if ((op0 & 0x7) == 0x7) ++block->simd;
    if ((op0 & 0x5) == 0x4) ++block->memory;
  }
  qemu_plugin_register_vcpu_tb_exec_cb(tb, block_runs, QEMU_PLUGIN_CB_NO_REGS, block);
}

static void system_call(qemu_plugin_id_t id, unsigned int cpu, int64_t number, uint64_t a1, uint64_t a2, uint64_t a3,
                        uint64_t a4, uint64_t a5, uint64_t a6, uint64_t a7, uint64_t a8) {
  (void)id, (void)cpu, (void)a2, (void)a3, (void)a4, (void)a5, (void)a6, (void)a7, (void)a8;
  if (number != kMarkCall || a1 >= kMostMarks) return;
  sums[a1].all += now.all - last.all;
  sums[a1].simd += now.simd - last.simd;
  sums[a1].memory += now.memory - last.memory;
  ++marks[a1];
  last = now;
}

static void program_ends(qemu_plugin_id_t id, void* data) {
  (void)id, (void)data;
  FILE* out = fopen(out_path, "w");
  if (out == NULL) {
    perror(out_path);
    return;
  }
  for (int i = 1; i < kMostMarks; ++i) {
    if (marks[i] != 0) {
      (void)fprintf(out, "%d %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", i, marks[i], sums[i].all, sums[i].simd,
                    sums[i].memory);
    }
  }
  if (fclose(out) != 0) perror(out_path);
}

QEMU_PLUGIN_EXPORT int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t* info, int argc, char** argv) {
  if (strcmp(info->target_name, "aarch64") != 0 || argc != 1 || strncmp(argv[0], "out=", 4) != 0) {
    (void)fprintf(stderr, "qemu_count: want qemu-aarch64 -plugin libqemu_count.so,out=FILE\n");
    return 1;
  }
  out_path = argv[0] + 4;  // stays valid
  qemu_plugin_register_vcpu_tb_trans_cb(id, block_is_translated);
  qemu_plugin_register_vcpu_syscall_cb(id, system_call);
  qemu_plugin_register_atexit_cb(id, program_ends, NULL);
  return 0;
}
