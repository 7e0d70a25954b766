# The Debian packages: components server, cli and dev. deploy/make-packages builds them.
# What only packages hold is left out of a plain `cmake --install`.
set(debian ${CMAKE_CURRENT_LIST_DIR})
set(systemd ${CMAKE_CURRENT_LIST_DIR}/../systemd)

install(FILES ${systemd}/marble-server.service DESTINATION /lib/systemd/system COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${systemd}/marble.sysusers DESTINATION /usr/lib/sysusers.d RENAME marble.conf COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${systemd}/marble.toml DESTINATION /etc/marble COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${debian}/marble-server.8 DESTINATION ${CMAKE_INSTALL_MANDIR}/man8 COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${debian}/marble-load.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT cli EXCLUDE_FROM_ALL)
foreach(component server cli dev)
  install(FILES ${debian}/copyright ${debian}/changelog DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/marble-${component}
          COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME marble)
set(CPACK_PACKAGE_VENDOR "Marble Server")
set(CPACK_PACKAGE_CONTACT "Marble Server maintainers <maintainers@marble.example>")
set(CPACK_SET_DESTDIR ON)  # for what lies outside /usr
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own, the first line of its description
set(CPACK_STRIP_FILES ON)
set(CPACK_PRE_BUILD_SCRIPTS ${debian}/finish_tree.cmake)
set(CPACK_COMPONENTS_ALL server cli dev)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)

set(CPACK_DEBIAN_SERVER_PACKAGE_NAME marble-server)
set(CPACK_DEBIAN_SERVER_PACKAGE_SECTION net)
set(CPACK_COMPONENT_SERVER_DESCRIPTION "solver service for complementarity constraints
Marble Server solves quadratic programs with linear complementarity
constraints: planning problems that mix continuous motion with contact, gates
and triggers. It takes sparse problems over gRPC, solves them on a pool of
threads and streams every iteration.

This package holds the server, its systemd unit and its configuration.")
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers | systemd-sysusers")
set(CPACK_DEBIAN_SERVER_PACKAGE_SUGGESTS "marble-cli, prometheus, libpq5 (>= 14), postgresql")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA
    ${debian}/conffiles ${debian}/postinst ${debian}/prerm ${debian}/postrm)

set(CPACK_DEBIAN_CLI_PACKAGE_NAME marble-cli)
set(CPACK_DEBIAN_CLI_PACKAGE_SECTION math)
set(CPACK_COMPONENT_CLI_DESCRIPTION "program for problems with complementarity constraints
Solves quadratic programs with linear complementarity constraints, in its own
process or on a Marble server; submits and watches jobs, converts problem
files of other tools and draws convergence. Its load tester reports what a
server holds.")
set(CPACK_DEBIAN_CLI_PACKAGE_RECOMMENDS ca-certificates)
set(CPACK_DEBIAN_CLI_PACKAGE_SUGGESTS "gnuplot-nox | gnuplot")
set(CPACK_DEBIAN_CLI_PACKAGE_CONFLICTS marble)  # the globe: /usr/bin/marble is its program too

set(CPACK_DEBIAN_DEV_PACKAGE_NAME marble-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_DEV_DESCRIPTION "C++ library of the Marble solver and its service
Headers, static libraries and CMake files to solve quadratic programs with
linear complementarity constraints in process or on a Marble server, and the
service's contract: its .proto files and their descriptor set.")
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "libexpected-dev, libgrpc++-dev, libprotobuf-dev, protobuf-compiler-grpc, libssl-dev, libopenblas-dev | liblapack-dev, libsuitesparse-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "cmake, g++")
set(CPACK_DEBIAN_DEV_PACKAGE_CONFLICTS libmarble-dev)  # the globe's: it owns /usr/include/marble too

include(CPack)
