# Compiler and linker flags of Debian's own builds (dpkg-buildflags with hardening=+all). Position independent programs are
# Debian's default. tests/install/elf_test.py checks the result.
add_compile_options(-fstack-protector-strong -fstack-clash-protection
                    "$<$<CONFIG:Release,RelWithDebInfo,MinSizeRel>:SHELL:-U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2>")
add_link_options(-Wl,-z,relro,-z,now)

# Control flow protection works only where every object of a program has it, the C library's start-up code included. In Debian
# 12 that code has none, so the flag would cost time and protect nothing.
execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=Scrt1.o OUTPUT_VARIABLE start_up OUTPUT_STRIP_TRAILING_WHITESPACE)
execute_process(COMMAND ${CMAKE_READELF} --wide --notes ${start_up} OUTPUT_VARIABLE notes ERROR_QUIET)
if(notes MATCHES "IBT, SHSTK")
  add_compile_options(-fcf-protection)
endif()
