"""Names of the C library and its headers, which no function or file of a kernel can have.

C99 to C23 and POSIX.1-2008 declare them, or compilers and libraries add them when no standard is set. Some, such as
``step``, stand in no header any more, and libraries still have them for old programs. A rule covers the names that end
in ``_t``. Only external names are concerned: a function can use any of these for a variable, unless it calls the
library's function.
"""

from __future__ import annotations

#: Functions, variables and headers, by the form that the name of a kernel can have.
_LIBRARY_TEXT = """
a64l abort abs accept access acct acos acosf acosh acoshf acoshl acosl acospi addmntent addseverity adjtime
adjtimex advance aio aio_cancel aio_error aio_fsync aio_read aio_return aio_suspend aio_write alarm
aligned_alloc alloca alphasort arc4random arc4random_buf arc4random_uniform argp asctime asctime_r asin asinf
asinh asinhf asinhl asinl asinpi asprintf assert at_quick_exit atan atan2 atan2f atan2l atan2pi atanf atanh
atanhf atanhl atanl atanpi atexit atof atoi atol atoll backtrace basename bcmp bcopy bdflush bind bindresvport
bindtextdomain brk bsearch btowc bzero c16rtomb c32rtomb cabs cabsf cabsl cacos cacosf cacosh cacoshf cacoshl
cacosl call_once calloc callrpc canonicalize canonicalize_file_name canonicalizef canonicalizel capget capset
carg cargf cargl casin casinf casinh casinhf casinhl casinl catan catanf catanh catanhf catanhl catanl
catclose catgets catopen cbrt cbrtf cbrtl ccos ccosf ccosh ccoshf ccoshl ccosl ceil ceilf ceill cexp cexpf
cexpl cfgetispeed cfgetospeed cfmakeraw cfree cfsetispeed cfsetospeed cfsetspeed chdir chflags chmod chown
chroot cimag cimagf cimagl clearenv clearerr clearerr_unlocked clock clock_adjtime clock_getcpuclockid
clock_getres clock_gettime clock_nanosleep clock_settime clog clog10 clog10f clog10l clogf clogl clone close
close_range closedir closefrom closelog cnd_broadcast cnd_destroy cnd_init cnd_signal cnd_timedwait cnd_wait
complex compoundn confstr conio conj conjf conjl connect copy_file_range copysign copysignf copysignl cos cosf
cosh coshf coshl cosl cospi cpio cpow cpowf cpowl cproj cprojf cprojl creal crealf creall creat crypt csin
csinf csinh csinhf csinhl csinl csqrt csqrtf csqrtl ctan ctanf ctanh ctanhf ctanhl ctanl ctermid ctime ctime_r
ctype cuserid daddl daemon daylight dcgettext dcngettext ddivl dfmal dgettext difftime dirent dirfd dirname
div dladdr dladdr1 dlclose dlerror dlfcn dlinfo dlmopen dlopen dlsym dlvsym dmull dngettext dprintf drand48
drand48_r drem dremf dreml dsqrtl dsubl dup dup2 dup3 duplocale dysize eaccess ecvt ecvt_r endaliasent
endfsent endgrent endhostent endian endmntent endnetent endnetgrent endprotoent endpwent endrpcent endservent
endsgent endspent endttyent endusershell endutent endutxent environ erand48 erand48_r erf erfc erfcf erfcl
erff erfl err errno error errx euidaccess eventfd execl execle execlp execv execve execveat execvp execvpe
exit exp exp10 exp10f exp10l exp10m1 exp2 exp2f exp2l exp2m1 expf expl explicit_bzero expm1 expm1f expm1l fabs
fabsf fabsl faccessat fadd faddl fallocate fattach fchdir fchflags fchmod fchmodat fchown fchownat fclose
fcloseall fcntl fcvt fcvt_r fdatasync fdetach fdim fdimf fdiml fdiv fdivl fdopen fdopendir features
feclearexcept fedisableexcept feenableexcept fegetenv fegetexcept fegetexceptflag fegetmode fegetround
feholdexcept fenv feof feof_unlocked feraiseexcept ferror ferror_unlocked fesetenv fesetexcept fesetexceptflag
fesetmode fesetround fetestexcept fetestexceptflag feupdateenv fexecve fflush fflush_unlocked ffma ffmal ffs
ffsl ffsll fgetc fgetc_unlocked fgetgrent fgetpos fgetpos64 fgetpwent fgets fgets_unlocked fgetsgent fgetspent
fgetwc fgetwc_unlocked fgetws fgetws_unlocked fgetxattr fileno fileno_unlocked finite finitef finitel
flistxattr float flock flockfile floor floorf floorl fma fmaf fmal fmax fmaxf fmaximum fmaximum_mag
fmaximum_mag_num fmaximum_mag_numf fmaximum_mag_numl fmaximum_magf fmaximum_magl fmaximum_num fmaximum_numf
fmaximum_numl fmaximumf fmaximuml fmaxl fmaxmag fmaxmagf fmaxmagl fmemopen fmin fminf fminimum fminimum_mag
fminimum_mag_num fminimum_mag_numf fminimum_mag_numl fminimum_magf fminimum_magl fminimum_num fminimum_numf
fminimum_numl fminimumf fminimuml fminl fminmag fminmagf fminmagl fmod fmodf fmodl fmtmsg fmul fmull fnmatch
fopen fopen64 fopencookie fork forkpty fpathconf fpclassify fprintf fprintf_unlocked fputc fputc_unlocked
fputs fputs_unlocked fputwc fputwc_unlocked fputws fputws_unlocked fread fread_unlocked free freeaddrinfo
freeifaddrs freelocale fremovexattr freopen freopen64 frexp frexpf frexpl fromfp fromfpf fromfpl fromfpx
fromfpxf fromfpxl fscanf fsconfig fseek fseeko fseeko64 fsetpos fsetpos64 fsetxattr fsmount fsopen fspick
fsqrt fsqrtl fstat fstatat fstatfs fstatvfs fsub fsubl fsync ftell ftello ftello64 ftime ftok ftruncate
ftruncate64 ftrylockfile ftw funlockfile futimens futimes futimesat fwide fwprintf fwrite fwrite_unlocked
fwscanf gai_strerror gamma gammaf gammaf_r gammal gammal_r gcvt get_current_dir_name getaddrinfo
getaliasbyname getaliasent getauxval getc getc_unlocked getchar getchar_unlocked getcontext getcpu getcwd
getdate getdate_err getdate_r getdelim getdirentries getdomainname getdtablesize getegid getentropy getenv
geteuid getfsent getfsfile getfsspec getgid getgrent getgrgid getgrgid_r getgrnam getgrnam_r getgrouplist
getgroups gethostbyaddr gethostbyname gethostbyname2 gethostent gethostid gethostname getifaddrs getitimer
getline getloadavg getlogin getlogin_r getmntent getmsg getnameinfo getnetbyaddr getnetbyname getnetent
getnetgrent getnetname getopt getpagesize getpass getpayload getpayloadf getpayloadl getpeername getpgid
getpgrp getpid getpmsg getppid getpriority getprotobyname getprotobynumber getprotoent getpt getpublickey
getpw getpwent getpwnam getpwnam_r getpwuid getpwuid_r getrandom getresgid getresuid getrlimit getrpcbyname
getrpcbynumber getrpcent getrpcport getrusage gets getsecretkey getservbyname getservbyport getservent
getsgent getsgnam getsid getsockname getsockopt getsourcefilter getspent getspnam getsubopt gettext gettid
gettimeofday getttyent getttynam getuid getusershell getutent getutid getutline getutmp getutmpx getutxent
getutxid getutxline getw getwc getwc_unlocked getwchar getwchar_unlocked getwd getxattr glob globfree gmtime
gmtime_r grantpt group_member grp gsignal gtty hasmntopt hcreate hdestroy herror hsearch hstrerror htonl htons
hypot hypotf hypotl i386 iconv iconv_close iconv_open if_freenameindex if_indextoname if_nameindex
if_nametoindex ilogb ilogbf ilogbl imaxabs imaxdiv in6addr_any in6addr_loopback index inet_addr inet_lnaof
inet_makeaddr inet_netof inet_network inet_ntoa inet_ntop inet_pton initgroups initstate initstate_r innetgr
insque inttypes io ioctl ioperm iopl iruserok isalnum isalnum_l isalpha isalpha_l isascii isastream isatty
isblank isblank_l iscntrl iscntrl_l isctype isdigit isdigit_l isfdtype isfinite isgraph isgraph_l isgreater
isgreaterequal isinf isinff isinfl isless islessequal islessgreater islower islower_l isnan isnanf isnanl
isnormal iso646 isprint isprint_l ispunct ispunct_l isspace isspace_l isunordered isupper isupper_l iswalnum
iswalnum_l iswalpha iswalpha_l iswblank iswblank_l iswcntrl iswcntrl_l iswctype iswctype_l iswdigit iswdigit_l
iswgraph iswgraph_l iswlower iswlower_l iswprint iswprint_l iswpunct iswpunct_l iswspace iswspace_l iswupper
iswupper_l iswxdigit iswxdigit_l isxdigit isxdigit_l itoa j0 j0f j0l j1 j1f j1l jn jnf jnl jrand48 jrand48_r
kill killpg klogctl l64a labs langinfo lchmod lchown lckpwdf lcong48 lcong48_r ldexp ldexpf ldexpl ldiv lfind
lgamma lgamma_r lgammaf lgammaf_r lgammal lgammal_r lgetxattr libgen limits link linkat linux lio_listio
listen listxattr llabs lldiv llistxattr llogb llogbf llogbl llrint llrintf llrintl llround llroundf llroundl
llseek loc1 loc2 locale localeconv localtime localtime_r lockf locs log log10 log10f log10l log10p1 log1p
log1pf log1pl log2 log2f log2l log2p1 logb logbf logbl logf login logl logout logp1 logwtmp longjmp lrand48
lrand48_r lremovexattr lrint lrintf lrintl lround lroundf lroundl lsearch lseek lseek64 lsetxattr lstat ltoa
lutimes madvise main makecontext mallinfo mallinfo2 malloc mallopt mallwatch math matherr mblen mbrlen
mbrtoc16 mbrtoc32 mbrtowc mbsinit mbsnrtowcs mbsrtowcs mbstowcs mbtowc mcheck mcount memalign memccpy memchr
memcmp memcpy memfrob memmem memmove memory mempcpy memrchr memset mincore mkdir mkdirat mkdtemp mkfifo
mkfifoat mknod mknodat mkostemp mkostemp64 mkostemps mkostemps64 mkstemp mkstemp64 mkstemps mkstemps64 mktemp
mktime mlock mlock2 mlockall mmap modf modff modfl moncontrol monetary monstartup mount mprobe mprotect
mq_close mq_getattr mq_notify mq_open mq_receive mq_send mq_setattr mq_timedreceive mq_timedsend mq_unlink
mqueue mrand48 mrand48_r mremap msgctl msgget msgrcv msgsnd msync mtrace mtx_destroy mtx_init mtx_lock
mtx_timedlock mtx_trylock mtx_unlock munlock munlockall munmap muntrace nan nanf nanl nanosleep nearbyint
nearbyintf nearbyintl netdb newlocale nextafter nextafterf nextafterl nextdown nextdownf nextdownl nexttoward
nexttowardf nexttowardl nextup nextupf nextupl nfsservctl nftw ngettext nice nl_langinfo nl_langinfo_l
nl_types nrand48 nrand48_r ntohl ntohs obstack_printf obstack_vprintf offsetof on_exit open open_memstream
open_wmemstream openat opendir openlog openpty optarg opterr optind optopt pathconf pause pclose perror
personality pipe pipe2 poll popen posix_fadvise posix_fallocate posix_madvise posix_memalign posix_openpt
posix_spawn posix_spawn_file_actions_addclose posix_spawn_file_actions_adddup2
posix_spawn_file_actions_addopen posix_spawn_file_actions_destroy posix_spawn_file_actions_init
posix_spawnattr_destroy posix_spawnattr_getflags posix_spawnattr_getpgroup posix_spawnattr_getschedparam
posix_spawnattr_getschedpolicy posix_spawnattr_getsigdefault posix_spawnattr_getsigmask posix_spawnattr_init
posix_spawnattr_setflags posix_spawnattr_setpgroup posix_spawnattr_setschedparam
posix_spawnattr_setschedpolicy posix_spawnattr_setsigdefault posix_spawnattr_setsigmask posix_spawnp pow pow10
powf powl pown powr ppoll prctl pread pread64 preadv preadv2 printf printf_unlocked prlimit process profil
program_invocation_name program_invocation_short_name pselect psiginfo psignal pthread pthread_atfork
pthread_attr_destroy pthread_attr_getdetachstate pthread_attr_getguardsize pthread_attr_getinheritsched
pthread_attr_getschedparam pthread_attr_getschedpolicy pthread_attr_getscope pthread_attr_getstack
pthread_attr_getstackaddr pthread_attr_getstacksize pthread_attr_init pthread_attr_setdetachstate
pthread_attr_setguardsize pthread_attr_setinheritsched pthread_attr_setschedparam pthread_attr_setschedpolicy
pthread_attr_setscope pthread_attr_setstack pthread_attr_setstackaddr pthread_attr_setstacksize
pthread_barrier_destroy pthread_barrier_init pthread_barrier_wait pthread_barrierattr_destroy
pthread_barrierattr_getpshared pthread_barrierattr_init pthread_barrierattr_setpshared pthread_cancel
pthread_cond_broadcast pthread_cond_destroy pthread_cond_init pthread_cond_signal pthread_cond_timedwait
pthread_cond_wait pthread_condattr_destroy pthread_condattr_getclock pthread_condattr_getpshared
pthread_condattr_init pthread_condattr_setclock pthread_condattr_setpshared pthread_create pthread_detach
pthread_equal pthread_exit pthread_getconcurrency pthread_getcpuclockid pthread_getschedparam
pthread_getspecific pthread_join pthread_key_create pthread_key_delete pthread_kill pthread_mutex_consistent
pthread_mutex_destroy pthread_mutex_getprioceiling pthread_mutex_init pthread_mutex_lock
pthread_mutex_setprioceiling pthread_mutex_timedlock pthread_mutex_trylock pthread_mutex_unlock
pthread_mutexattr_destroy pthread_mutexattr_getprioceiling pthread_mutexattr_getprotocol
pthread_mutexattr_getpshared pthread_mutexattr_getrobust pthread_mutexattr_gettype pthread_mutexattr_init
pthread_mutexattr_setprioceiling pthread_mutexattr_setprotocol pthread_mutexattr_setpshared
pthread_mutexattr_setrobust pthread_mutexattr_settype pthread_once pthread_rwlock_destroy pthread_rwlock_init
pthread_rwlock_rdlock pthread_rwlock_timedrdlock pthread_rwlock_timedwrlock pthread_rwlock_tryrdlock
pthread_rwlock_trywrlock pthread_rwlock_unlock pthread_rwlock_wrlock pthread_rwlockattr_destroy
pthread_rwlockattr_getkind_np pthread_rwlockattr_getpshared pthread_rwlockattr_init
pthread_rwlockattr_setkind_np pthread_rwlockattr_setpshared pthread_self pthread_setcancelstate
pthread_setcanceltype pthread_setconcurrency pthread_setschedparam pthread_setschedprio pthread_setspecific
pthread_sigmask pthread_sigqueue pthread_spin_destroy pthread_spin_init pthread_spin_lock pthread_spin_trylock
pthread_spin_unlock pthread_testcancel ptrace ptsname ptsname_r putc putc_unlocked putchar putchar_unlocked
putenv putgrent putmsg putpmsg putpwent puts putsgent putspent pututline pututxline putw putwc putwc_unlocked
putwchar putwchar_unlocked pvalloc pwd pwrite pwrite64 pwritev pwritev2 python qecvt qecvt_r qfcvt qfcvt_r
qgcvt qsort qsort_r quick_exit quotactl raise rand rand_r random random_r rawmemchr rcmd re_syntax_options
read readahead readdir readdir_r readlink readlinkat readv realloc reallocarray realpath reboot recv recvfrom
recvmmsg recvmsg regcomp regerror regex regexec regfree registerrpc remainder remainderf remainderl remove
removexattr remque remquo remquof remquol rename renameat renameat2 revoke rewind rewinddir rexec rexecoptions
rindex rint rintf rintl rmdir rootn round roundeven roundevenf roundevenl roundf roundl rpmatch rresvport
rsqrt rtime ruserok ruserpass sbrk scalb scalbf scalbl scalbln scalblnf scalblnl scalbn scalbnf scalbnl
scandir scandirat scanf sched sched_get_priority_max sched_get_priority_min sched_getparam sched_getscheduler
sched_rr_get_interval sched_setparam sched_setscheduler sched_yield search secure_getenv seed48 seed48_r
seekdir select sem_close sem_destroy sem_getvalue sem_init sem_open sem_post sem_timedwait sem_trywait
sem_unlink sem_wait semaphore semctl semget semop semtimedop send sendfile sendmmsg sendmsg sendto setaliasent
setbuf setbuffer setcontext setdomainname setegid setenv seteuid setfsent setfsgid setfsuid setgid setgrent
setgroups sethostent sethostid sethostname setitimer setjmp setlinebuf setlocale setlogin setlogmask setmntent
setnetent setnetgrent setns setpayload setpayloadf setpayloadl setpayloadsig setpayloadsigf setpayloadsigl
setpgid setpgrp setpriority setprotoent setpwent setregid setresgid setresuid setreuid setrlimit setrpcent
setservent setsgent setsid setsockopt setsourcefilter setspent setstate setstate_r settimeofday setttyent
setuid setusershell setutent setutxent setvbuf setxattr sgetsgent sgetspent shm_open shm_unlink shmat shmctl
shmdt shmget shutdown sigabbrev_np sigaction sigaddset sigaltstack sigandset sigblock sigdelset sigdescr_np
sigemptyset sigfillset siggetmask sighold sigignore siginterrupt sigisemptyset sigismember siglongjmp signal
signalfd signbit signgam significand significandf significandl sigorset sigpause sigpending sigprocmask
sigqueue sigrelse sigreturn sigset sigsetmask sigstack sigsuspend sigtimedwait sigvec sigwait sigwaitinfo sin
sincos sincosf sincosl sinf sinh sinhf sinhl sinl sinpi sleep snprintf sockatmark socket socketpair spawn
splice sprintf sprofil sqrt sqrtf sqrtl srand srand48 srand48_r srandom srandom_r sscanf ssignal sstk stat
statfs statvfs statx stdalign stdarg stdatomic stdbit stdbool stdckdint stddef stderr stdin stdint stdio
stdlib stdnoreturn stdout step stime stpcpy stpncpy strcasecmp strcasecmp_l strcasestr strcat strchr strchrnul
strcmp strcoll strcoll_l strcpy strcspn strdup strerror strerror_l strerror_r strerrordesc_np strerrorname_np
strfmon strfmon_l strfromd strfromf strfroml strfry strftime strftime_l string strings strlcat strlcpy strlen
strncasecmp strncasecmp_l strncat strncmp strncpy strndup strnlen stropts strpbrk strptime strptime_l strrchr
strsep strsignal strspn strstr strtod strtod_l strtof strtof128_l strtof32_l strtof64_l strtof_l strtoimax
strtok strtok_r strtol strtol_l strtold strtold_l strtoll strtoll_l strtoq strtoul strtoul_l strtoull
strtoull_l strtoumax strtouq strverscmp strxfrm strxfrm_l stty swab swapcontext swapoff swapon swprintf
swscanf symlink symlinkat sync syncfs syscall sysconf sysctl sysexits sysinfo syslog system sysv_signal tan
tanf tanh tanhf tanhl tanl tanpi tar tcdrain tcflow tcflush tcgetattr tcgetpgrp tcgetsid tcsendbreak tcsetattr
tcsetpgrp tdelete tdestroy tee telldir tempnam termio termios textdomain tfind tgamma tgammaf tgammal tgkill
tgmath thrd_create thrd_current thrd_detach thrd_equal thrd_exit thrd_join thrd_sleep thrd_yield threads time
timegm timelocal timer_create timer_delete timer_getoverrun timer_gettime timer_settime times timespec_get
timespec_getres timezone tmpfile tmpfile64 tmpnam tmpnam_r toascii tolower tolower_l totalorder totalorderf
totalorderl totalordermag totalordermagf totalordermagl toupper toupper_l towctrans towctrans_l towlower
towlower_l towupper towupper_l trunc truncate truncate64 truncf truncl tsearch tss_create tss_delete tss_get
tss_set ttyname ttyname_r ttyslot twalk tzname tzset ualarm uchar ufromfp ufromfpf ufromfpl ufromfpx ufromfpxf
ufromfpxl ulckpwdf ulimit umask umount umount2 uname ungetc ungetwc unistd unix unlink unlinkat unlockpt
unsetenv unshare updwtmp updwtmpx uselib uselocale usleep ustat utime utimensat utimes utmpname utmpx
utmpxname utoa va_arg va_copy va_end va_start valloc values vasprintf vdprintf verr verrx versionsort vfork
vfprintf vfscanf vfwprintf vfwscanf vhangup vlimit vmsplice vprintf vscanf vsnprintf vsprintf vsscanf
vswprintf vswscanf vsyslog vtimes vwarn vwarnx vwprintf vwscanf wait waitid waitpid warn warnx wchar wcpcpy
wcpncpy wcrtomb wcscasecmp wcscasecmp_l wcscat wcschr wcschrnul wcscmp wcscoll wcscoll_l wcscpy wcscspn wcsdup
wcsftime wcsftime_l wcslen wcsncasecmp wcsncasecmp_l wcsncat wcsncmp wcsncpy wcsnlen wcsnrtombs wcspbrk
wcsrchr wcsrtombs wcsspn wcsstr wcstod wcstod_l wcstof wcstof128_l wcstof32_l wcstof64_l wcstof_l wcstoimax
wcstok wcstol wcstol_l wcstold wcstold_l wcstoll wcstoll_l wcstombs wcstoq wcstoul wcstoul_l wcstoull
wcstoull_l wcstoumax wcstouq wcswcs wcswidth wcsxfrm wcsxfrm_l wctob wctomb wctrans wctrans_l wctype wctype_l
wcwidth windows wmemchr wmemcmp wmemcpy wmemmove wmempcpy wmemset wordexp wordfree wprintf write writev wscanf
xdecrypt xencrypt y0 y0f y0l y1 y1f y1l yn ynf ynl
"""
LIBRARY = frozenset(_LIBRARY_TEXT.split())
