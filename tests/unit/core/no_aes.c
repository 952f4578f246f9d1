// For the loader to put before a program: a CPU without the AES instructions, as Highway asks for them.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sys/auxv.h>

unsigned long getauxval(unsigned long type) {
  typedef unsigned long Asked(unsigned long);
  Asked* asked = (Asked*)dlsym(RTLD_NEXT, "getauxval");
  return type == AT_HWCAP ? asked(type) & ~(unsigned long)HWCAP_AES : asked(type);
}
